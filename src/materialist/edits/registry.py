"""All operations: what command line, lists of edits, batches and the studio offer. Nothing slow is imported here."""

from __future__ import annotations

from typing import TYPE_CHECKING

from materialist.edits.core.operation import Operation
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


def effect_notes(scene: Scene, edited: Scene, change: float) -> list[str]:
    """What the edits say of a picture, or of a film's most changed frame, that has no more than that `mean_change`."""
    from materialist.edits.core.notes import LITTLE

    if change >= LITTLE:
        return []
    new = edited.provenance.get("edits", ())[len(scene.provenance.get("edits", ())) :]
    kinds = {facts["kind"] for facts in new}
    notes = (operation.faint for operation in OPERATIONS.values() if operation.kind in kinds)
    return [note.format(levels=255 * change) for note in notes if note]
