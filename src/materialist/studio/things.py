"""Things that are put into the photo: placed, changed, and let fall; steps `insert` and `drop` of the list of edits."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from materialist.edits.recipe import DROP, Step
from materialist.errors import InputError
from materialist.studio.stack import told

if TYPE_CHECKING:
    from materialist.studio.session import Session

KINDS = ("insert", "drop")


def in_hand(session: Session) -> Step | None:
    """The thing of the list that is chosen."""
    stack = session.stack
    return stack.steps[stack.current] if stack.current is not None and session.in_hand in KINDS else None


def last(session: Session) -> int | None:
    """The place of the thing that is chosen, else of the last one in the list."""
    stack = session.stack
    if session.in_hand in KINDS:
        return stack.current
    return max((k for kind in KINDS if (k := stack.last(kind)) is not None), default=None)


def place(session: Session, x: float, y: float) -> None:
    """Stand the thing in hand at a pixel, or let it fall there if it fell; else a new one. Raises InputError."""
    with session.lock:
        _ = session.scene
        at = [f"{x:.0f}", f"{y:.0f}"]
        step = in_hand(session)
        stack = session.stack
        if step is None:
            if "mesh" not in session.thing:
                raise InputError("Choose an object from the list, or upload one, first.")
            step = Step("insert", session.thing, session.desk)
            stack = stack.add(step)
        assert stack.current is not None
        session.change("place", stack.put(stack.current, told(step, at=at)))


def option(session: Session, name: str, value: str | None) -> None:
    """Set or clear (None) an option of the thing in hand, and of the next one. Raises InputError."""
    with session.lock:
        if name == "mesh":  # another object is a new one
            session.stack = session.stack.chosen(None)
        step = in_hand(session)
        session.thing = {k: v for k, v in {**session.thing, name: value}.items() if v is not None}
        if step is not None and (step.kind == "insert" or name in DROP):
            assert session.stack.current is not None
            after = session.stack.put(session.stack.current, told(step, **{name: value}))
            colours = all(str(one).startswith("#") for one in (step.options.get(name), value))
            session.change(f"{name} of {after.current}", after, moving=name in ("scale", "turn") or colours)


def take_up(session: Session) -> None:
    """The next thing is like the one in hand, as the controls show it."""
    step = in_hand(session)
    if step is not None and isinstance(step.options.get("mesh"), str):
        session.thing = {k: step.options[k] for k in ("mesh", "scale", "turn", "material") if k in step.options}


def let_fall(session: Session, height: float) -> list[str]:
    """The thing in hand, else the last one, falls where it stands and lies where it comes to rest.

    One that has fallen falls again, and tumbles in another way, as does one that fell in vain. The fall takes seconds,
    in which the page goes on.
    Returns sentences on what did not go as expected.

    Raises:
        InputError: there is none, it falls beside everything, or the list was changed meanwhile. SetupError: the
            physics is not installed.
    """
    with session.lock:
        _ = session.scene
        stack, live, index = session.stack, session.live, last(session)
        if index is None or live is None:
            raise InputError("Place an object first; it falls where it stands.")
        thing = stack.steps[index]
        trial = stack.put(index, fallen(thing, height, tries(session, thing)))
    known = set(live.edited(stack.active).report.warnings)
    try:
        notes = live.edited(trial.active).report.warnings  # kept there: the picture that follows finds it
    except InputError:
        fell_in_vain(session, thing)
        raise
    with session.lock:
        if session.stack.steps != stack.steps:
            raise InputError("The list of edits was changed while the object fell; let it fall again.")
        session.remember("fall")
        session.stack = trial
        session.save()
    return [note for note in notes if note not in known]


def tries(session: Session, step: Step) -> int:
    """How often a thing fell in vain."""
    thing, count = session.failed_fall
    return count if thing == step else 0


def fell_in_vain(session: Session, step: Step) -> None:
    """Let a thing tumble in another way the next time."""
    session.failed_fall = (step, tries(session, step) + 1)


def fallen(step: Step, height: float, tried: int = 0) -> Step:
    """The `drop` that takes the place of an `insert`; of a `drop`, one with the next seed, and so on when tried."""
    options = {k: v for k, v in step.options.items() if k in (*DROP, "skip") and k not in ("height", "seed")}
    seed = tried + (int(step.options.get("seed", 0)) + 1 if step.kind == "drop" else 0)
    return replace(step, kind="drop", options={**options, "height": f"{height:.3g}", "seed": str(seed)})
