"""The operation `drop`: in a list of edits, things that have fallen and lie still."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, Placement, PreviewMode, Target
from materialist.edits.drop.options import Drop

if TYPE_CHECKING:
    from materialist.types import Scene


def _check_libraries() -> None:
    from materialist.edits.drop.physics import check_libraries

    check_libraries()


def _apply(scene: Scene, target: Placement, options: Any, fitted: Scene) -> Scene:
    from materialist.edits.drop.drop import settle

    places: Any = target.places
    return settle(scene, target.meshes, places, options)


DROP = Operation(
    options=Drop,
    kind="drop",
    target=Target.PLACE,
    apply=_apply,
    about="Let meshes fall onto what the photo shows.",
    label="Fallen",
    preview=PreviewMode.SIMULATED,
    check_libraries=_check_libraries,
)
