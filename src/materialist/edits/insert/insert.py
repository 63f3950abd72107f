"""Meshes put into the photograph (paper, Object insertion and relighting; Shadow Effects)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import unit
from materialist.edits.core.notes import noted, warned
from materialist.edits.insert.meshes import MeshModel, read_model, repainted
from materialist.edits.insert.support import Support, picture_width, support_at
from materialist.errors import InputError
from materialist.options import Insertion
from materialist.types import Array, Body, Scene


@dataclass(frozen=True)
class InsertSettings:
    """Size of an inserted mesh; tuned by eye."""

    width: float = 1 / 6  # longest side at scale 1, share of the width that the picture shows at its depth
    nearest: float = 0.02  # depth that nothing may come nearer than, share of the depth of its place
    samples: int = 6000  # points that stand for its surface where it falls


SETTINGS = InsertSettings()


def insert(
    scene: Scene, mesh: str | Path | MeshModel, at: tuple[float, float], options: Insertion | None = None, **values: Any
) -> Scene:
    """The scene with a mesh standing on the surface under a pixel, one more body for each material of the mesh.

    What is wrong with the mesh, or its place, is added to `report.warnings`.

    Args:
        mesh: an OBJ, PLY, STL, glTF or GLB file, or what `meshes.read_model` made of one.
        at: (x, y) at working size: where the middle of its base stands. Its up axis is the surface's normal, its
            front (+Z) looks to the camera.
        options, values: see `options.Insertion`; `values` are fields of it, as in `insert(scene, mesh, at, scale=2)`.

    Raises InputError for a place outside the photo, on the sky, or so near that the mesh would reach behind the
    camera; a mesh that cannot be used; a number out of its range.
    """
    wanted = Insertion.given(options, **values)
    model = repainted(mesh if isinstance(mesh, MeshModel) else read_model(mesh, up=wanted.up), wanted.material)
    placed, _, longest = put(scene, model, at, scale=wanted.scale, turn=wanted.turn, size=wanted.size)
    what: dict[str, Any] = {
        "mesh": model.name, "at": [float(v) for v in at], "scale": wanted.scale, "turn": wanted.turn,
        "material": wanted.material, "size": longest, "triangles": sum(len(body.faces) for body in placed),
    }  # fmt: skip
    return noted(warned(replace(scene, bodies=(*scene.bodies, *placed)), *model.warnings), "insert", what)


def put(
    scene: Scene, model: MeshModel, at: tuple[float, float], *, scale: float = 1.0, turn: float = 0.0,
    size: float | None = None,
) -> tuple[tuple[Body, ...], Support, float]:  # fmt: skip
    """The model's parts as they stand in the camera frame, the plane they stand on, and their longest side.

    The side is the model's own, in scene units; see `insert`.
    """
    from scipy.spatial.transform import Rotation

    low, high = model.vertices.min(0).astype(np.float64), model.vertices.max(0).astype(np.float64)
    longest = float((high - low).max())
    first = support_at(scene, at)
    unit = scale * (size if size is not None else SETTINGS.width * picture_width(scene, first.depth)) / longest
    footprint = unit * float(np.hypot(high[0] - low[0], high[2] - low[2])) / 2
    support = support_at(scene, at, footprint)
    base = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    turned = frame(support) @ Rotation.from_euler("y", turn, degrees=True).as_matrix()
    bodies = tuple(moved(part, turned * unit, support.point - (turned * unit) @ base) for part in model.parts)
    nearest = -max(float(body.vertices[:, 2].max()) for body in bodies)
    if nearest < SETTINGS.nearest * support.depth:
        raise InputError(
            f"{model.name} would reach behind the camera at scale {scale:g}; choose a smaller scale, or a place "
            "further away."
        )
    return bodies, support, unit * longest


def frame(support: Support) -> Array:
    """[3, 3] rotation whose columns are right, up (the normal) and front: towards the camera along the surface.

    Where the surface faces the camera, front is down the picture instead.
    """
    up = support.normal
    towards = -unit(support.point)
    front = towards - (towards @ up) * up
    down = np.array([0.0, -1.0, 0.0])
    down = down - (down @ up) * up
    share = np.clip((np.linalg.norm(front) - 0.2) / 0.2, 0, 1)  # a steep wall turns gently from one to the other
    front = share * front + (1 - share) * down
    if np.linalg.norm(front) < 1e-6:
        front = np.cross([1.0, 0.0, 0.0], up)
    front = unit(front)
    return np.stack([np.cross(up, front), up, front], -1)


def moved(body: Body, linear: Array, shift: Array) -> Body:
    """The body under x -> linear x + shift; `linear` [3, 3] is a rotation times a factor."""
    factor = np.cbrt(np.linalg.det(linear))
    vertices = (body.vertices.astype(np.float64) @ linear.T + shift).astype(np.float32)
    normals = (body.normals.astype(np.float64) @ (linear / factor).T).astype(np.float32)
    return replace(body, vertices=vertices, normals=normals)


def surface_points(body: Body) -> Array:
    """[n, 3] points evenly over the body's surface, always the same ones."""
    from trimesh import Trimesh, sample

    return np.asarray(
        sample.sample_surface(Trimesh(body.vertices, body.faces, process=False), SETTINGS.samples, seed=0)[0]
    )
