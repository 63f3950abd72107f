"""Triangles of the plane region where a field is positive, by marching squares."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from materialist.types import Array

# Slots of a cell: corners 0 to 3 clockwise from the top left (y down), then the crossings of its top, right, bottom
# and left side, 4 to 7. Triangles turn as top left, bottom left, bottom right do: counter-clockwise with y up.
_POLYGONS: dict[int, tuple[tuple[int, ...], ...]] = {
    1: ((0, 7, 4),), 2: ((1, 4, 5),), 4: ((2, 5, 6),), 8: ((3, 6, 7),),
    3: ((0, 7, 5, 1),), 6: ((1, 4, 6, 2),), 12: ((2, 5, 7, 3),), 9: ((3, 6, 4, 0),),
    5: ((0, 7, 4), (2, 5, 6)), 10: ((1, 4, 5), (3, 6, 7)),
    7: ((1, 0, 7, 6, 2),), 14: ((2, 1, 4, 7, 3),), 13: ((3, 2, 5, 4, 0),), 11: ((0, 3, 6, 5, 1),),
    15: ((0, 3, 2, 1),),
}  # fmt: skip
"""Corner pattern (bit k: corner k is inside) -> polygons; corners across a diagonal stay apart."""
_CLEAR = 0.04
"""A crossing keeps this part of a cell's side from both corners, so that no triangle has two points in one."""


class Region(NamedTuple):
    """A triangulated part of the plane."""

    points: Array
    """[V, 2] float64 (x, y), y down."""
    faces: Array
    """[F, 3] int64, counter-clockwise seen with y up."""
    border: Array
    """[B, 2] int64 edges with one face only, in that face's direction; every vertex on one has one in and one out."""


def region(field: Array) -> Region:
    """The region where `field` [H, W] > 0, interpolated linearly between the grid points (x, y) = (column, row).

    Values beyond the grid count as negative at once: a caller who wants a smooth end there leaves a margin.
    """
    height, width = field.shape
    inside = field > 0
    points = np.argwhere(inside)[:, ::-1].astype(np.float64)
    corner = np.full((height, width), -1, np.int64)
    corner[inside] = np.arange(len(points))
    across, found_x = _crossings(field, inside, len(points))
    down, found_y = _crossings(field.T, inside.T, len(points) + len(found_x))
    points = np.concatenate([points, found_x, found_y[:, ::-1]])
    down = down.T  # [H-1, W] vertex on the side between (i, j) and (i+1, j)
    slots = np.stack(
        [corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1],
         across[:-1], down[:, 1:], across[1:], down[:, :-1]], -1,
    )  # fmt: skip
    kind = inside[:-1, :-1] + 2 * inside[:-1, 1:] + 4 * inside[1:, 1:] + 8 * inside[1:, :-1]
    faces = []
    for pattern, polygons in _POLYGONS.items():
        cells = slots[kind == pattern]
        for polygon in polygons:
            fan = [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
            faces.append(cells[:, np.array(fan)].reshape(-1, 3))
    joined = np.concatenate(faces)
    edges = np.concatenate([joined[:, [0, 1]], joined[:, [1, 2]], joined[:, [2, 0]]])
    lone = ~np.isin(edges[:, 0] * len(points) + edges[:, 1], edges[:, 1] * len(points) + edges[:, 0])
    return Region(points, joined, edges[lone])


def _crossings(field: Array, inside: Array, first: int) -> tuple[Array, Array]:
    """Vertices on horizontal sides: their numbers [H, W-1] from `first` on, -1 for none, and (x, y) [n, 2]."""
    crossed = inside[:, :-1] != inside[:, 1:]
    number = np.full(crossed.shape, -1, np.int64)
    number[crossed] = first + np.arange(crossed.sum())
    rows, columns = np.nonzero(crossed)
    left, right = field[rows, columns], field[rows, columns + 1]
    part = np.clip(left / (left - right), _CLEAR, 1 - _CLEAR)
    return number, np.stack([columns + part, rows], -1).astype(np.float64)
