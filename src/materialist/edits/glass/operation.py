"""The operation `glass`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, PreviewMode, Target
from materialist.edits.glass.options import Glass

if TYPE_CHECKING:
    from materialist.types import Array, Scene


def _apply(scene: Scene, region: Array, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.glass.glass import glass

    return glass(scene, region, options, fitted=fitted)


def _summary(edited: Scene) -> str:
    facts = edited.provenance["edits"][-1]
    return f"{facts['pixels']} pixels are glass; thickness: {facts['thickness']}."


GLASS = Operation(
    options=Glass,
    kind="glass",
    target=Target.REGION,
    apply=_apply,
    about="Turn an object to glass: what is behind it is continued, and seen through it.",
    label="Glass",
    bare="clear",
    preview=PreviewMode.TRACED,
    summary=_summary,
)
