"""Shading normals of meshes whose files have none."""

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from materialist.edits.core.surfaces import edge_keys, welded
from materialist.types import Array

CHUNK = 1 << 18
"""Faces that are looked at in one go: bounds the memory."""


def creased_normals(
    vertices: Array, faces: Array, degrees: float, pieces: Array | None = None
) -> tuple[Array, Array]:
    """(number [F, 3] of the normal of each corner, unit normals [N, 3] float64) of vertices [V, 3], faces [F, 3].

    Faces that meet at a sharper angle keep an edge; those that meet at a smaller one, or are linked by such, share
    the mean of their normals, weighted by their angles. Vertices at one place count as one, but for those of
    different `pieces` [V].
    """
    places = vertices if pieces is None else np.column_stack([vertices, pieces])
    corners = welded(places)[faces]
    flat = _unit(area_vectors(vertices, faces))
    group = _smooth_groups(corners, flat, np.cos(np.radians(degrees)))
    # --- One normal for each pair of smooth group and vertex ---
    key = group[:, None].astype(np.int64) * (int(corners.max(initial=0)) + 1) + corners
    _, inverse = np.unique(key, return_inverse=True)
    number = inverse.astype(np.int32).reshape(-1, 3)
    # --- Sums of the faces' normals, weighted by their angles there ---
    weights = _angles(vertices, faces)
    total = np.empty((int(number.max(initial=-1)) + 1, 3))
    for axis in range(3):
        share = weights * flat[:, axis, None]
        total[:, axis] = np.bincount(number.ravel(), share.ravel(), len(total))
    return number, _unit(total)


def area_vectors(vertices: Array, faces: Array) -> Array:
    """[F, 3] float64 normals of faces, as long as twice their area."""
    areas = np.empty((len(faces), 3))
    for start in range(0, len(faces), CHUNK):
        a, b, c = np.moveaxis(vertices[faces[start : start + CHUNK]].astype(np.float64), 1, 0)
        areas[start : start + CHUNK] = np.cross(b - a, c - a)
    return areas


def _smooth_groups(corners: Array, flat: Array, cosine: float) -> Array:
    """[F] number of the group of each face."""
    # --- Pairs of faces that share an edge: equal keys stand side by side once sorted ---
    keys = edge_keys(corners)
    order = np.argsort(keys, kind="stable").astype(np.int32)
    keys = keys[order]
    shared = np.flatnonzero(keys[1:] == keys[:-1])
    first = order[shared] // 3
    second = order[shared + 1] // 3
    # --- Groups: faces linked by edges that are not sharp ---
    smooth = np.einsum("ij,ij->i", flat[first], flat[second]) >= cosine
    first = first[smooth]
    second = second[smooth]
    links = coo_array((np.ones(len(first), bool), (first, second)), shape=(len(flat), len(flat)))
    return np.asarray(connected_components(links, directed=False)[1])


def _angles(vertices: Array, faces: Array) -> Array:
    """[F, 3] float32 angle at each corner, radians."""
    angles = np.empty(faces.shape, np.float32)
    for start in range(0, len(faces), CHUNK):
        corner = vertices[faces[start : start + CHUNK]].astype(np.float64)
        after = _unit(np.roll(corner, -1, 1) - corner)
        before = _unit(np.roll(corner, 1, 1) - corner)
        cosine = np.einsum("fki,fki->fk", after, before)
        angles[start : start + CHUNK] = np.arccos(np.clip(cosine, -1, 1))
    return angles


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return vectors / np.where(length > 0, length, 1)
