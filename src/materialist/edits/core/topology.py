"""Closed or open: the edges and the volume of a triangle mesh whose vertices may be doubled."""

from __future__ import annotations

import numpy as np

from materialist.types import Array


def places(vertices: Array) -> Array:
    """[V] a number for each place: vertices within a millionth of the shape's size of each other share it."""
    extent = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    grid = np.round((vertices - vertices.min(0)) / extent * 1e6).astype(np.int64)
    return np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1)


def edge_faults(vertices: Array, faces: Array) -> tuple[int, int]:
    """(edges with one face, edges with three or more) of a mesh of vertices [V, 3] and faces [F, 3].

    Vertices at one place count as one.
    """
    place = places(vertices)[faces]
    place = place[(place[:, 0] != place[:, 1]) & (place[:, 1] != place[:, 2]) & (place[:, 2] != place[:, 0])]
    edges = np.sort(place[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, count = np.unique(edges[:, 0] * (int(place.max(initial=0)) + 1) + edges[:, 1], return_counts=True)
    return int((count == 1).sum()), int((count > 2).sum())


def volume(vertices: Array, faces: Array) -> float:
    """Signed volume of a closed mesh of vertices [V, 3] and faces [F, 3], in cubes of their unit.

    It is > 0 where faces run counter-clockwise seen from outside.
    """
    a, b, c = (vertices[faces[:, k]].astype(np.float64) - vertices.mean(0) for k in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)
