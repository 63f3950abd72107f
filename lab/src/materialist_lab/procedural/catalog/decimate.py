"""Coarser meshes, by merging vertices that are close to each other in place, direction and texture."""

import numpy as np

from materialist.types import Array
from materialist_lab.procedural.catalog.creases import creased
from materialist_lab.procedural.objects.shapes import Solid, face_normals

CREASE = 0.9
"""Radians: faces of a coarse mesh that meet at a sharper angle keep an edge."""


def decimated(solid: Solid, share: float) -> Solid:
    """The solid with about that share of its faces; leaves and thin parts lose whole faces."""
    max_faces = max(64, int(len(solid.faces) * share))
    area = np.linalg.norm(face_normals(solid.vertices, solid.faces), axis=-1)
    cell = 0.7 * float(np.sqrt(np.median(area)))
    coarse = solid
    for _ in range(16):
        coarse = _merged(solid, cell)
        if len(coarse.faces) <= max_faces:
            break
        cell *= 1.4
    # Vertices of different texture at one place lie apart by less than a cell: they meet again for their normals.
    source, faces, normals = creased(coarse.vertices, coarse.faces, CREASE)
    return Solid(coarse.vertices[source], faces, normals, coarse.uv[source])


def _merged(solid: Solid, cell: float) -> Solid:
    """Vertices of one cell of a grid and one cell of the texture as one."""
    texture = np.floor(solid.uv * 16 / max(float(np.ptp(solid.uv, axis=0).max()), 1.0))
    keys = np.concatenate([np.floor(solid.vertices / cell), texture], axis=-1).astype(np.int64)
    # One number for each cell; that two cells get the same is as good as impossible.
    factors = np.random.default_rng(0).integers(1, 2**62, keys.shape[1]) | 1
    _, group = np.unique((keys * factors).sum(1), return_inverse=True)
    vertices, uv = (_means(group, values) for values in (solid.vertices, solid.uv))
    faces = group[solid.faces].astype(np.int32)
    distinct = (
        (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 0] != faces[:, 2])
    )
    faces = np.unique(faces[distinct], axis=0) if distinct.any() else faces[:0]
    area = np.linalg.norm(face_normals(vertices, faces), axis=-1)
    return Solid(vertices, faces[area > 1e-12 * cell**2], np.zeros_like(vertices), uv)


def _means(group: Array, values: Array) -> Array:
    count = np.maximum(np.bincount(group), 1)
    return np.stack([np.bincount(group, column) / count for column in values.T], -1)
