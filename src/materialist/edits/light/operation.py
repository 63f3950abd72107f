"""The operation `relight`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, PreviewMode, Target
from materialist.edits.light.options import Relight

if TYPE_CHECKING:
    from materialist.types import Array, Scene

FAINT = (
    "The new light changes the picture by {levels:.1f} of 255 levels in the mean: the light that was found is nearly "
    "even, or the new one does not reach what the photo shows. A lamp, a stronger or lower sun, or a smaller ambient "
    "shows more."
)


def _apply(scene: Scene, lights: Array | None, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.light.relight import relight

    return relight(scene, options, lights=lights, fitted=fitted)


RELIGHT = Operation(
    options=Relight,
    kind="light",
    target=Target.LIGHT,
    apply=_apply,
    about="Show the photo under other light.",
    label="Light",
    preview=PreviewMode.SHADED,
    needed=("envmap", "rotate", "sun", "lamps", "ambient", "dim"),
    faint=FAINT,
)
