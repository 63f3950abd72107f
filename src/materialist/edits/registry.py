"""All operations: what command line, lists of edits, batches and the studio offer. Nothing slow is imported here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from materialist.edits.core.operation import Operation, new_edits
from materialist.edits.drop.operation import DROP
from materialist.edits.glass.operation import GLASS
from materialist.edits.insert.operation import INSERT
from materialist.edits.light.operation import RELIGHT
from materialist.edits.material.operation import EDIT
from materialist.edits.remove.operation import REMOVE

if TYPE_CHECKING:
    from materialist.types import Scene

OPERATIONS: dict[str, Operation] = {
    operation.name: operation for operation in (EDIT, GLASS, REMOVE, INSERT, RELIGHT, DROP)
}
"""By name, in the order of the help."""


def picture_notes(scene: Scene, edited: Scene, change: float) -> list[str]:
    """What the edits between two scenes say of their picture, or of a film's most changed frame; see `mean_change`."""
    kinds = {facts["kind"] for facts in new_edits(scene, edited)}
    notes: list[str] = []
    for operation in OPERATIONS.values():
        if operation.notes is not None and operation.kind in kinds:
            notes += operation.notes(scene, edited, change)
    return notes
