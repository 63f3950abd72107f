"""Objects that are put into the photo: made, placed, changed, and let fall; steps `insert` and `drop` of the list."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from materialist.edits.recipe import KINDS as STEPS
from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio.edit_list import with_options
from materialist.studio.session import Session

KINDS = ("insert", "drop")
LIBRARY = ("Ball", "Cube", "Cylinder", "Cone", "Ring", "Slab")
MATERIALS = (("As it is", "as-is"), ("Glass", "glass"), ("Mirror", "mirror"), ("Colour", "colour"))


def in_hand(session: Session) -> Step | None:
    """The object of the list that is chosen."""
    return session.edits.in_hand if session.in_hand in KINDS else None


def last(session: Session) -> int | None:
    """The place of the object that is chosen, else of the last one in the list."""
    if session.in_hand in KINDS:
        return session.edits.current
    return max((k for k, step in enumerate(session.edits.steps) if step.kind in KINDS), default=None)


def place(session: Session, x: float, y: float) -> None:
    """Stand the object in hand at a pixel, or let it fall there if it fell; else a new one. Raises InputError."""
    with session.lock:
        _ = session.scene
        at = [f"{x:.0f}", f"{y:.0f}"]
        step = in_hand(session)
        edits = session.edits
        if step is None:
            if "mesh" not in session.next_object:
                raise InputError("Choose an object from the list, or upload one, first.")
            step = Step("insert", session.next_object, session.workspace)
            edits = edits.add(step)
        assert edits.current is not None
        session.change("place", edits.put(edits.current, with_options(step, at=at)))


def set_option(session: Session, name: str, value: str | None) -> None:
    """Set or clear (None) an option of the object in hand, and of the next one. Raises InputError."""
    with session.lock:
        if name == "mesh":  # another object is a new one
            session.edits = session.edits.chosen(None)
        step = in_hand(session)
        session.next_object = {k: v for k, v in {**session.next_object, name: value}.items() if v is not None}
        if step is not None and (step.kind == "insert" or name in STEPS["drop"]):
            assert session.edits.current is not None
            after = session.edits.put(session.edits.current, with_options(step, **{name: value}))
            colours = all(str(one).startswith("#") for one in (step.options.get(name), value))
            session.change(f"{name} of {after.current}", after, moving=name in ("scale", "turn") or colours)


def let_fall(session: Session, height: float) -> list[str]:
    """The object in hand, else the last one, falls where it stands and lies where it comes to rest.

    One that has fallen falls again, and tumbles in another way, as does one that fell in vain. The fall takes seconds,
    in which the page goes on.
    Returns sentences on what did not go as expected.

    Raises:
        InputError: there is none, it falls beside everything, or the list was changed meanwhile. SetupError: the
            physics is not installed.
    """
    with session.lock:
        _ = session.scene
        edits, live, index = session.edits, session.live, last(session)
        if index is None or live is None:
            raise InputError("Place an object first; it falls where it stands.")
        thing = edits.steps[index]
        trial = edits.put(index, fallen(thing, height, failures(session, thing)))
    known = set(live.edited(edits.active).report.warnings)
    try:
        notes = live.edited(trial.active).report.warnings  # kept there: the picture that follows finds it
    except InputError:
        note_failure(session, thing)
        raise
    with session.lock:
        if session.edits.steps != edits.steps:
            raise InputError("The list of edits was changed while the object fell; let it fall again.")
        session.remember("fall")
        session.edits = trial
        session.save()
    return [note for note in notes if note not in known]


def failures(session: Session, step: Step) -> int:
    """How often the fall of an object failed."""
    fallen_before, count = session.failed_fall
    return count if fallen_before == step else 0


def note_failure(session: Session, step: Step) -> None:
    """Let an object tumble in another way the next time."""
    session.failed_fall = (step, failures(session, step) + 1)


def fallen(step: Step, height: float, tried: int = 0) -> Step:
    """The `drop` that takes the place of an `insert`; of a `drop`, one with the next seed, and so on when tried."""
    kept = {*STEPS["drop"], "skip"} - {"height", "seed"}
    options = {k: v for k, v in step.options.items() if k in kept}
    seed = tried + (int(step.options.get("seed", 0)) + 1 if step.kind == "drop" else 0)
    return replace(step, kind="drop", options={**options, "height": f"{height:.3g}", "seed": str(seed)})


def file_of(name: str) -> str:
    """The file name of a computed mesh."""
    return f"thing-{name.lower()}.ply"


def library_file(session: Session, name: str) -> str:
    """A computed mesh as a file in the workspace, +Y up."""
    file = session.workspace / file_of(name)
    if not file.is_file():
        shape(name).export(file)
    return file.name


def shape(name: str) -> Any:
    """One of the library as a trimesh, +Y up, longest side 1."""
    import numpy as np
    from trimesh import creation, transformations

    made: dict[str, Callable[[], Any]] = {
        "Ball": lambda: creation.icosphere(subdivisions=4, radius=0.5),
        "Cube": lambda: creation.box((1, 1, 1)),
        "Cylinder": lambda: creation.cylinder(0.3, 1, sections=96),
        "Cone": lambda: creation.cone(0.4, 1, sections=96),
        "Ring": lambda: creation.torus(0.35, 0.15, major_sections=96, minor_sections=48),
        "Slab": lambda: creation.box((1, 1, 0.12)),
    }
    mesh = made[name]()
    # trimesh builds along +Z; a ring lies flat as it is.
    mesh.apply_transform(transformations.rotation_matrix(-np.pi / 2, [1, 0, 0]))
    return mesh
