"""The operation `insert`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from materialist.edits.core.operation import Operation, Placement, Target
from materialist.edits.insert.options import Insertion
from materialist.errors import InputError

if TYPE_CHECKING:
    from materialist.types import Scene


def _apply(scene: Scene, target: Placement, options: Any, fitted: Scene) -> Scene:
    """One after the other: the last stands on what the first ones are."""
    from materialist.edits.insert.insert import insert
    from materialist.edits.insert.meshes import MeshModel, read_model

    if len(target.meshes) != 1:
        raise InputError(
            f"An insert takes one mesh, not {len(target.meshes)}; give one insert each."
        )
    (mesh,) = target.meshes
    model = mesh if isinstance(mesh, MeshModel) else read_model(mesh, up=options.up)
    for x, y in target.places:
        scene = insert(scene, model, (x, y), options)
    return scene


def _summary(edited: Scene) -> str:
    facts = edited.provenance["edits"][-1]
    return f"{facts['mesh']}: longest side {facts['size']:.3g} scene units."


INSERT = Operation(
    options=Insertion,
    kind="insert",
    target=Target.PLACE,
    apply=_apply,
    about="Put a mesh into the photo: it stands on what is there, casts its shadow and is reflected.",
    label="Object",
    summary=_summary,
)
