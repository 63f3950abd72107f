"""The profile of a surface of revolution: the signed distance to its border on a grid of the half plane."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.spatial import cKDTree
from skimage.measure import find_contours, grid_points_in_poly

from materialist.camera import unit
from materialist.geometry.slopes import sampled
from materialist.types import Array

MARGIN = 8
"""Cells around the border."""


@dataclass(frozen=True)
class Profile:
    """Signed distance to the border, below 0 in the body, above a flat base."""

    values: Array
    """[h, w] in cells: rows from the lowest, columns from the axis."""
    cell: float
    """Scene units."""
    low: float
    """Height of the first row, scene units."""
    floor: float
    """Height of the base, scene units."""

    @classmethod
    def of(cls, line: Array, cell: float, floor: float) -> Self:
        """The profile inside a line [K, 2] (distance from the axis, height) that runs from its foot up to the axis."""
        low = min(float(line[:, 1].min()), floor) - MARGIN * cell
        # --- The polygon of the line, in cells, and which cells are in it ---
        corners = (line - [0, low]) / cell  # (column, row)
        shape = tuple(int(np.ceil(n)) + MARGIN for n in corners.max(0)[::-1])
        # The polygon reaches one cell beyond the axis, whose column is inside.
        closed = np.concatenate([corners, [[-1, corners[-1, 1]], [-1, corners[0, 1]]]])
        inside = grid_points_in_poly(shape, closed[:, ::-1])
        # --- Signed distance to its border, smoothed by a cell ---
        along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))])
        # Distance to the border: to the nearest of points every tenth of a cell along it.
        fine = np.arange(0, along[-1], 0.1)
        border = np.stack([np.interp(fine, along, corners[:, k]) for k in (0, 1)], -1)
        rows, columns = np.indices(shape)
        away, _ = cKDTree(border).query(np.stack([columns, rows], -1))
        signed = np.where(inside, -away, away)
        whole = np.concatenate([signed[:, :0:-1], signed], 1)  # both sides of the axis
        return cls(gaussian_filter(whole, 1.0, mode="nearest")[:, shape[1] - 1 :], cell, low, floor)

    @property
    def size(self) -> tuple[float, float]:
        """Distance from the axis, and height above the base, up to which the body may reach, scene units."""
        rows, columns = self.values.shape
        return columns * self.cell, self.low + (rows - MARGIN) * self.cell - self.floor

    def at(self, places: Array) -> Array:
        """[...] the function at places [..., 2]: below 0 in the body, outside at most the cells to its border."""
        cells = ((places - [0, self.low]) / self.cell).reshape(-1, 2)
        flat = sampled(self.values, cells, order=1).reshape(places.shape[:-1])
        # Below the base the distance to the line is no bound: the height below it is.
        under = (self.floor - places[..., 1]) / self.cell
        return np.where(under > 0, under, np.maximum(flat, under))

    def slope(self, places: Array) -> Array:
        """[N, 2] how the function rises at places [N, 2]; at the floor straight down."""
        column, row = ((places - [0, self.low]) / self.cell).T
        at_floor = row <= (self.floor - self.low) / self.cell + 1
        return np.where(at_floor[:, None], [0.0, -1], self._slope(np.stack([column, row], -1)))

    def lines(self, level: float = 0.0) -> list[tuple[Array, Array]]:
        """The border of what lies deeper than `level` scene units: lines [K, 2] and their outward normals [K, 2].

        The body is to the left. Lines begin and end at the axis, or are closed.
        """
        bottom = (self.floor + level - self.low) / self.cell  # rows
        rows = np.arange(self.values.shape[0])[:, None]
        cut = np.maximum(self.values + level / self.cell, bottom - rows)
        # The outermost cells count as outside, so that every contour closes or ends at the axis.
        cut[[0, -1]] = np.maximum(cut[[0, -1]], 1)
        cut[:, -1] = np.maximum(cut[:, -1], 1)
        lines = []
        # --- Contours as places in scene units; bits of a contour are left out ---
        for line in find_contours(cut, 0.0):
            line = line[:, ::-1]  # (column, row)
            line = line[np.r_[True, np.abs(np.diff(line, axis=0)).max(1) > 1e-6]]
            place = line * self.cell + [0, self.low]
            if len(line) < 4 or not (
                np.allclose(line[0], line[-1]) or max(line[0, 0], line[-1, 0]) < 1e-6
            ):
                continue
            # On the base the normal is straight down, else up the slope of the distance.
            normal = unit(
                np.where((line[:, 1] <= bottom + 1e-3)[:, None], [0.0, -1], self._slope(line))
            )
            # Turn the line round where the outward normal is to its left: the body must be there.
            along = np.gradient(line, axis=0)
            if np.sum(along[:, 0] * normal[:, 1] - along[:, 1] * normal[:, 0]) > 0:
                place = place[::-1]
                normal = normal[::-1]
            lines.append((place, normal))
        return lines

    def _slope(self, at: Array) -> Array:
        """[K, 2] gradient at (column, row)."""
        # One more column, mirrored at the axis, makes the difference there a central one.
        whole = np.concatenate([self.values[:, 1:2], self.values], 1)
        up, out = np.gradient(whole)
        return sampled(np.stack([out, up], -1), at + np.array([1, 0]), order=1)
