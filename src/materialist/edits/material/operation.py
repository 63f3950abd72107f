"""The operation `edit`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, PreviewMode, Target
from materialist.edits.material.options import MaterialEdit

if TYPE_CHECKING:
    from materialist.types import Array, Scene


def _apply(scene: Scene, region: Array, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.material.material import edit

    return edit(scene, region, options)


def _summary(edited: Scene) -> str:
    pixels = edited.provenance["edits"][-1]["pixels"]
    return f"{pixels} pixels edited, {pixels / edited.depth.size:.0%} of the photo."


EDIT = Operation(
    options=MaterialEdit,
    kind="material",
    target=Target.REGION,
    apply=_apply,
    about="Change the material of a region, and get the photo back with only that changed.",
    label="Material",
    preview=PreviewMode.SHADED,
    needed=("hue", "saturation", "value", "albedo", "texture", "roughness", "metallic"),
    summary=_summary,
)
