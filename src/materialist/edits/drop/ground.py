"""What things fall onto: the reconstructed surface as a height field along gravity, cut into convex blocks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.types import Array

CELLS = 128
"""Cells along each side of the field."""
STEEP = 0.15
"""Height over the floor, as a share of the thing's size, from which upright surfaces count."""
BLOCKS = 1500
"""Most blocks; the flatness that a block must have is relaxed until there are no more."""


@dataclass(frozen=True)
class Field:
    """Heights over a square of ground, z up."""

    corner: Array
    """[2] x and y of the first grid point."""
    cell: float
    """Distance of grid points."""
    height: Array
    """[n + 1, n + 1] z of the surface at (x, y) = corner + cell * (column, row); NaN where there is none."""


def field(shoot, points: Array, centre: Array, half: float, top, size: float) -> Field:
    """The surface below z = `top` in a square around `centre` [2].

    Args:
        shoot: shoot(x [n], y [n], z [n]) -> z [n] of what a ray downwards meets first, NaN for nothing.
        points: [m, 3] points of the visible surface. Rays along gravity miss what is upright; where such points stand
            out of the field by more than STEEP * size, they raise it.
        half: half of the square's side. top: top(x [n], y [n]) -> z [n]. size: longest side of the falling thing.
    """
    steps = np.linspace(-half, half, CELLS + 1)
    x, y = np.meshgrid(centre[0] + steps, centre[1] + steps)
    height = shoot(x.ravel(), y.ravel(), top(x.ravel(), y.ravel())).reshape(x.shape)
    cell = 2 * half / CELLS
    low = np.nanmin(height) if np.isfinite(height).any() else 0.0
    column = np.round((points[:, 0] - x[0, 0]) / cell).astype(int)
    row = np.round((points[:, 1] - y[0, 0]) / cell).astype(int)
    inside = (column >= 0) & (column <= CELLS) & (row >= 0) & (row <= CELLS)
    inside &= points[:, 2] < top(points[:, 0], points[:, 1])
    column, row, z = column[inside], row[inside], points[inside, 2]
    upright = z > np.nan_to_num(height[row, column], nan=low - size) + STEEP * size
    np.fmax.at(height, (row[upright], column[upright]), z[upright])
    return Field(np.array([x[0, 0], y[0, 0]]), cell, height)


def blocks(ground: Field, *, flat: float, depth: float) -> list[Array]:
    """Corners [8, 3] of convex blocks whose tops are the field, to within `flat`, and which reach `depth` below it.

    Large where the ground is plane: a square is halved in both directions until its grid points lie on a plane.
    """
    for relaxed in range(8):
        found: list[Array] = []
        _split(ground, 0, 0, ground.height.shape[0] - 1, flat * 2**relaxed, depth, found)
        if len(found) <= BLOCKS:
            break
    return found


def tops(ground: Field, found: list[Array]) -> Array:
    """[n, n, 4] z of the blocks over each cell of the field, at its corners in the order of a block's; NaN: none."""
    n = ground.height.shape[0] - 1
    result = np.full((n, n, 4), np.nan)
    for block in found:
        (column, row), (right, under) = np.round((block[[0, 3], :2] - ground.corner) / ground.cell).astype(int)
        steps = np.linspace(0, 1, right - column + 1)
        a, b, c, d = block[:4, 2]
        v, u = steps[:, None], steps[None, :]
        z = (1 - v) * ((1 - u) * a + u * b) + v * ((1 - u) * c + u * d)  # a plane where it spans several cells
        result[row:under, column:right] = np.stack([z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]], -1)
    return result


def _split(ground: Field, row: int, column: int, n: int, flat: float, depth: float, found: list[Array]) -> None:
    part = ground.height[row : row + n + 1, column : column + n + 1]
    known = np.isfinite(part)
    if not known.any() or (n == 1 and known.sum() < 4):
        return
    if n == 1:
        found.append(_block(ground, row, column, 1, part[[0, 0, 1, 1], [0, 1, 0, 1]], depth))
        return
    if known.all():
        y, x = np.mgrid[: n + 1, : n + 1]
        system = np.stack([np.ones(x.size), x.ravel(), y.ravel()], -1)
        plane = np.linalg.lstsq(system, part.ravel(), rcond=None)[0]
        if np.abs(system @ plane - part.ravel()).max() <= flat:
            tops = np.array([[1, 0, 0], [1, n, 0], [1, 0, n], [1, n, n]]) @ plane
            found.append(_block(ground, row, column, n, tops, depth))
            return
    half = n // 2
    for r in (row, row + half):
        for c in (column, column + half):
            _split(ground, r, c, half, flat, depth, found)


def _block(ground: Field, row: int, column: int, n: int, tops: Array, depth: float) -> Array:
    """[8, 3]: four corners with their heights, and four far below."""
    x = ground.corner[0] + ground.cell * (column + n * np.array([0, 1, 0, 1]))
    y = ground.corner[1] + ground.cell * (row + n * np.array([0, 0, 1, 1]))
    return np.concatenate([np.stack([x, y, tops], -1), np.stack([x, y, np.full(4, tops.min() - depth)], -1)])
