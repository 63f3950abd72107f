"""Polygons as triangles, whatever their shape."""

from collections.abc import Iterator

import mapbox_earcut
import numpy as np

from materialist.edits.insert.formats.source import MeshSource
from materialist.types import Array

CHUNK = 1 << 18
"""Corners that are looked at in one go: bounds the memory."""
REFLEX = -1e-6
"""Sine of the turn at a corner below which it points inwards; rounding of flat corners stays above."""


def triangulated(
    source: MeshSource, points: Array, counts: Array, corners: Array
) -> tuple[Array, Array]:
    """(triangles [F, 3] as positions in `corners`, polygon [F] of each) of polygons of `counts` [P] corners.

    points [V, 3]; corners [C] numbers of points, polygon after polygon. Polygons below three corners have none.
    Raises InputError for a polygon that is not convex and has too many corners, and for too many triangles.
    """
    source.check("faces", int(np.maximum(counts - 2, 0).sum()))
    starts = np.cumsum(counts) - counts
    faces: list[Array] = [np.zeros((0, 3), np.int32)]
    owners: list[Array] = [np.zeros(0, np.int32)]
    for size in np.unique(counts[counts >= 3]):
        rows = np.flatnonzero(counts == size)
        step = max(CHUNK // int(size), 1)
        for begin in range(0, len(rows), step):
            chosen = rows[begin : begin + step]
            index = starts[chosen, None] + np.arange(size)
            for triangles, owner in _cut(source, points, corners, index):
                faces.append(triangles.astype(np.int32))
                owners.append(chosen[owner].astype(np.int32))
    return np.concatenate(faces), np.concatenate(owners)


def _cut(
    source: MeshSource, points: Array, corners: Array, index: Array
) -> Iterator[tuple[Array, Array]]:
    """(triangles [F, 3], row [F]) of polygons of one size, whose corners are at `index` [P, n]."""
    size = index.shape[1]
    if size == 3:
        yield index, np.arange(len(index))
        return
    # --- Which corners point inwards? ---
    outline = points[corners[index]].astype(np.float64)
    outline = outline - outline[:, :1]
    normal = np.cross(outline, np.roll(outline, -1, 1)).sum(1)  # Newell: twice the area
    reflex = _turns(outline, normal) < REFLEX
    if size == 4:  # a diagonal from the corner that points inwards lies within
        index = np.take_along_axis(index, (reflex.argmax(1)[:, None] + np.arange(4)) % 4, 1)
        reflex = np.zeros_like(reflex)
    # --- Convex: a fan about the first corner ---
    simple = ~reflex.any(1)
    fans = np.stack([np.repeat(index[:, :1], size - 2, 1), index[:, 1:-1], index[:, 2:]], -1)
    yield fans[simple].reshape(-1, 3), np.repeat(np.flatnonzero(simple), size - 2)
    # --- Not convex: ears are cut off one by one ---
    hollow = np.flatnonzero(~simple)
    if len(hollow):
        source.check("polygon", int(size))
        triangles, row = _ears(outline[hollow], normal[hollow])
        yield index[hollow[row, None], triangles], hollow[row]


def _turns(outline: Array, normal: Array) -> Array:
    """[P, n] sine of the turn at each corner of outlines [P, n, 3], seen against their normals [P, 3]."""
    after = np.roll(outline, -1, 1) - outline
    before = np.roll(after, 1, 1)
    turn = (np.cross(before, after) * normal[:, None]).sum(-1)
    scale = np.linalg.norm(before, axis=-1) * np.linalg.norm(after, axis=-1)
    scale = scale * np.linalg.norm(normal, axis=-1)[:, None]
    return turn / np.where(scale > 0, scale, 1)


def _ears(outline: Array, normal: Array) -> tuple[Array, Array]:
    """(triangles [F, 3] as corners, row [F]) of outlines [P, n, 3]; they face as their normals [P, 3] do."""
    across = np.eye(3)[np.abs(normal).argmin(1)]
    right = np.cross(across, normal)
    plane = np.stack([right, np.cross(normal, right)], -1)
    plane = plane / np.maximum(np.linalg.norm(plane, axis=1, keepdims=True), 1e-300)
    # Outlines in their planes [P, n, 2]; vertices that are not finite are refused later.
    flat = np.nan_to_num(outline @ plane, posinf=0, neginf=0)
    ring = np.array([outline.shape[1]], np.uint32)
    ears = [
        np.asarray(mapbox_earcut.triangulate_float64(corners, ring), np.int64) for corners in flat
    ]
    triangles = np.concatenate(ears).reshape(-1, 3)
    row = np.repeat(np.arange(len(flat)), [len(ear) // 3 for ear in ears])
    # The library may turn triangles round: those that face away are turned back.
    corner = flat[row[:, None], triangles]
    first = corner[:, 1] - corner[:, 0]
    second = corner[:, 2] - corner[:, 0]
    behind = first[:, 0] * second[:, 1] < first[:, 1] * second[:, 0]
    triangles[behind] = triangles[behind, ::-1]
    return triangles, row
