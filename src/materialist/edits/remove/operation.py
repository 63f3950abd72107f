"""The operation `remove`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, Target
from materialist.edits.remove.options import Removal

if TYPE_CHECKING:
    from materialist.types import Array, Scene


def _apply(scene: Scene, region: Array, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.remove.remove import remove

    return remove(scene, region, options, fitted=fitted)


def _summary(edited: Scene) -> str:
    return f"{edited.provenance['edits'][-1]['pixels']} pixels taken away."


REMOVE = Operation(
    options=Removal,
    kind="remove",
    target=Target.REGION,
    apply=_apply,
    about="Take an object out of the photo, with its shadow and its reflections.",
    label="Removed",
    bare="the object",
    summary=_summary,
)
