"""What the stage shows of a session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from time import time
from typing import TYPE_CHECKING, Any

from materialist.edits.recipe import Step
from materialist.errors import MaterialistError
from materialist.studio import glass, views
from materialist.studio.live import LIVE
from materialist.studio.stack import Stack
from materialist.types import Array

if TYPE_CHECKING:
    from materialist.studio.session import Session


@dataclass(frozen=True)
class Final:
    """A path-traced picture."""

    steps: tuple[Step, ...]
    """The edits in it."""
    path: Path
    """Its files (.png, .exr, .jpg), without the ending."""
    spp: int
    """Paths a pixel."""

    def of(self, steps: tuple[Step, ...]) -> bool:
        """Whether it shows these edits."""
        return bool(steps) and self.steps == steps


def stage(session: Session, *, edits: bool = True) -> dict[str, Any]:
    """The picture as a data URL, the outlines of the selection, the lamps, and what the picture is.

    Without `edits` it is the photo, at once. Where there are any, it has no picture until the preview is ready: the
    page keeps the one it shows, and `tab_open` sends it then. Where they cannot be applied it is the photo, with the
    reason on it: what is wrong can be taken out of the list. Glass in hand is asked for; `asked` counts these wishes,
    and `waiting` says whether the last is not fulfilled yet. The page ignores a picture with an older `serial` than
    the one it shows.
    """
    serial = time()
    with session.lock:
        live, stack, final = session.live, session.stack, session.final
        masks, tracer = session.mask_urls, session.glass
    if live is None:
        none = {"picture": "", "width": 0, "height": 0, "badge": "", "lamps": [], "waiting": False, "bad": False}
        return {**none, "serial": serial, **masks}
    camera, steps = live.scene.camera, stack.active if edits else ()
    size = {"width": camera.width, "height": camera.height}
    shown = {**size, "lamps": _lamps(stack), "serial": serial, "bad": False, **masks}
    off = "; the edit in hand is switched off" if _in_hand_off(stack) else ""
    if final is not None and final.of(steps):
        badge = f"Path traced, {final.spp} paths a pixel{off}"
        return {**shown, "picture": views.file_url(final.path.with_suffix(".jpg")), "badge": badge, "waiting": False}
    state = _asked(tracer, stack) if edits and tracer is not None else None
    waiting = state is not None and state.waiting
    if steps and not live.ready:
        return {**shown, "badge": "Getting the live preview ready …", "waiting": False}
    try:
        linear = live.picture(steps, tracer)
    except MaterialistError as error:
        photo, badge = views.jpeg_url(live.scene.photo.linear), f"The photo without its edits: {error}"
        return {**shown, "picture": photo, "badge": badge, "waiting": False, "bad": True}
    shown |= {"asked": state.asked if state else 0, "waiting": waiting}
    return {**shown, "picture": views.jpeg_url(linear), "badge": _badge(steps, tracer, waiting) + off}


def picture(session: Session) -> Array:
    """[H, W, 3] float32 linear: what the stage shows where nothing is path traced."""
    assert session.live is not None
    return session.live.picture(session.stack.active, session.glass)


def _asked(tracer: glass.Tracer, stack: Stack) -> glass.State:
    """Ask for the glass in hand, if there is any."""
    step = stack.steps[stack.current] if stack.current is not None else None
    if step is not None and glass.traced(step) and not step.skipped:
        tracer.ask(_others(stack.active, step), step)
    return tracer.state


def _in_hand_off(stack: Stack) -> bool:
    """Whether sliders move what is not in the picture."""
    return stack.current is not None and stack.steps[stack.current].skipped


def _others(steps: tuple[Step, ...], step: Step) -> tuple[Step, ...]:
    return tuple(one for one in steps if one is not step)


def _lamps(stack: Stack) -> list[list[float]]:
    """(x, y) of the lamps, for their marks; none where they are not readable, which the picture tells."""
    place = stack.light
    lamps = stack.steps[place].options.get("lamps", []) if place is not None else []
    try:
        return [[float(v) for v in lamp[:2]] for lamp in lamps if isinstance(lamp, list)]
    except (TypeError, ValueError):
        return []


def _badge(steps: tuple[Step, ...], tracer: glass.Tracer | None = None, waiting: bool = False) -> str:
    """What a picture that is not path traced shows, and what it leaves out."""
    if not steps:
        return "Photo"
    panes = [step for step in steps if glass.traced(step)]
    sketched = "; objects are sketched" if any(s.kind not in LIVE and s not in panes for s in steps) else ""
    if waiting:
        known = all(tracer and tracer.pane(step) for step in panes)
        return ("Glass: tracing …" if known else "Glass: sketch, tracing …") + sketched
    if panes and tracer and all(tracer.fresh(_others(steps, step), step) for step in panes):
        return f"Glass traced; shadow and caustics in the final picture{sketched}"
    if panes and tracer and all(tracer.pane(step) for step in panes):
        return f"Live preview; click the glass in the list to trace it anew{sketched}"
    if any(step.kind not in LIVE for step in steps):
        return "Sketch: path tracing shows the rest"
    if any("lamps" in step.options for step in steps):
        return "Live preview: lamps show in path tracing"
    return "Live preview"
