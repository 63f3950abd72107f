"""What the stage shows of a session."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from materialist.edit.recipe import Step
from materialist.studio import views
from materialist.studio.live import LIVE
from materialist.studio.stack import Stack

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

    Without `edits` it is the photo, at once; with them it waits for the preview where there are any.
    """
    with session.lock:
        live, stack, final = session.live, session.stack, session.final
        masks = session.mask_urls
    if live is None:
        return {"picture": "", "width": 0, "height": 0, "badge": "", "lamps": [], **masks}
    camera, steps = live.scene.camera, stack.active if edits else ()
    shown = {"width": camera.width, "height": camera.height, "lamps": _lamps(stack), **masks}
    if final is not None and final.of(steps):
        badge = f"Path traced, {final.spp} paths a pixel"
        return {**shown, "picture": views.file_url(final.path.with_suffix(".jpg")), "badge": badge}
    return {**shown, "picture": views.jpeg_url(live.picture(steps)), "badge": _badge(steps)}


def _lamps(stack: Stack) -> list[list[float]]:
    """(x, y) of the lamps, for their marks."""
    place = stack.last("relight")
    lamps = stack.steps[place].options.get("lamps", []) if place is not None else []
    return [[float(v) for v in lamp[:2]] for lamp in lamps if isinstance(lamp, list)]


def _badge(steps: tuple[Step, ...]) -> str:
    """What a picture that is not path traced shows, and what it leaves out."""
    if not steps:
        return "Photo"
    if any(step.kind not in LIVE for step in steps):
        return "Sketch: path tracing shows the rest"
    if any("lamps" in step.options for step in steps):
        return "Live preview: lamps show in path tracing"
    return "Live preview"
