"""The operation `relight`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, PreviewMode, Target
from materialist.edits.light.options import Relight

if TYPE_CHECKING:
    from materialist.types import Array, Scene


def _apply(scene: Scene, lights: Array | None, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.light.relight import relight

    return relight(scene, options, lights=lights, fitted=fitted)


def _notes(scene: Scene, edited: Scene, change: float) -> list[str]:
    from materialist.edits.core.notes import effect_notes

    return effect_notes(scene, edited, change)


RELIGHT = Operation(
    options=Relight,
    kind="light",
    target=Target.LIGHT,
    apply=_apply,
    about="Show the photo under other light.",
    label="Light",
    preview=PreviewMode.SHADED,
    needed=("envmap", "rotate", "sun", "lamps", "ambient", "dim"),
    notes=_notes,
)
