"""The profile of a lathed body: where the half plane beside the axis is full, from points with normals on its border.

A function that is 0 on the border, negative in the body, and rises by one a cell, as smooth as the points allow (the
implicit surface of Turk and O'Brien 2002, on a grid): what no point tells goes on as it went.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.types import Array


@dataclass(frozen=True)
class ProfileSettings:
    """How smooth the function is; tuned by eye."""

    bend: float = 0.03  # weight of second differences against that of points: larger is smoother
    lean: float = 2.0  # weight of normals against that of places
    margin: int = 12  # cells around what is seen
    beside: float = 2.5  # cells within which a line must have a point that is seen, to be of the object


DEFAULT = ProfileSettings()


@dataclass(frozen=True)
class Profile:
    """The function on a grid."""

    values: Array
    """[h, w] in cells: rows from the lowest, columns from the axis."""
    cell: float
    """Scene units."""
    low: float
    """Height of the first row, scene units."""
    floor: float
    """Height below which nothing is, scene units."""
    seen: Array
    """[N, 2] points (distance, height) that it was fitted to."""
    off: float
    """Root mean square of the function at them, cells."""

    def at(self, places: Array) -> Array:
        """[...] the function at places [..., 2]: below 0 in the body."""
        flat = _read(self.values, ((places - [0, self.low]) / self.cell).reshape(-1, 2)).reshape(places.shape[:-1])
        return np.maximum(flat, (self.floor - places[..., 1]) / self.cell)

    def slope(self, places: Array) -> Array:
        """[N, 2] how the function rises at places [N, 2]; at the floor straight down."""
        column, row = ((places - [0, self.low]) / self.cell).T
        at_floor = row <= (self.floor - self.low) / self.cell + 1
        return np.where(at_floor[:, None], [0.0, -1], self._slope(np.stack([column, row], -1)))

    def lines(self, level: float = 0.0) -> list[tuple[Array, Array]]:
        """The border of what lies deeper than `level` scene units: lines [K, 2] and their outward normals [K, 2].

        The body is to the left. Lines begin and end at the axis, or are closed.
        """
        from scipy.spatial import cKDTree
        from skimage.measure import find_contours

        bottom = (self.floor + level - self.low) / self.cell  # rows
        rows = np.arange(self.values.shape[0])[:, None]
        cut = np.maximum(self.values + level / self.cell, bottom - rows)
        cut[[0, -1]], cut[:, -1] = np.maximum(cut[[0, -1]], 1), np.maximum(cut[:, -1], 1)
        tree, found = cKDTree(self.seen), []
        for line in find_contours(cut, 0.0):
            line = line[:, ::-1]  # (column, row)
            line = line[np.r_[True, np.abs(np.diff(line, axis=0)).max(1) > 1e-6]]
            place = line * self.cell + [0, self.low]
            ends = np.allclose(line[0], line[-1]) or max(line[0, 0], line[-1, 0]) < 1e-6
            if len(line) < 4 or not ends or tree.query(place)[0].min() > DEFAULT.beside * self.cell + level:
                continue
            normal = np.where((line[:, 1] <= bottom + 1e-3)[:, None], [0.0, -1], self._slope(line))
            normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-9)
            along = np.gradient(line, axis=0)
            if np.sum(along[:, 0] * normal[:, 1] - along[:, 1] * normal[:, 0]) > 0:
                place, normal = place[::-1], normal[::-1]
            found.append((place, normal))
        return found

    def _slope(self, at: Array) -> Array:
        """[K, 2] gradient at (column, row)."""
        from scipy.ndimage import map_coordinates

        whole = np.concatenate([self.values[:, 1:2], self.values], 1)  # the same on the other side of the axis
        up, out = np.gradient(whole)
        read = lambda v: map_coordinates(v, [at[:, 1], at[:, 0] + 1], order=1, mode="nearest")  # noqa: E731
        return np.stack([read(out), read(up)], -1)


def fitted(seen: Array, leaning: Array, cell: float, floor: float) -> Profile:
    """The profile through points of its border.

    Args:
        seen: [N, 2] distance from the axis and height. leaning: [N, 2] unit normals there, outwards.
        cell, floor: as of `Profile`.
    """
    from scipy.sparse.linalg import splu

    bottom, high = float(seen[:, 1].min()), float(np.ptp(seen[:, 1]))
    low = min(bottom, max(floor, bottom - high)) - DEFAULT.margin * cell
    shape = (
        int(np.ceil((seen[:, 1].max() - low) / cell)) + DEFAULT.margin,
        int(np.ceil(seen[:, 0].max() / cell)) + DEFAULT.margin,
    )
    at = (seen - [0, low]) / cell  # (column, row)
    rows, wanted = _points(at, leaning, shape)
    matrix = rows.T @ rows + DEFAULT.bend * _bending(shape)
    values = splu(matrix.tocsc()).solve(rows.T @ wanted).reshape(shape)
    return Profile(values, cell, low, floor, seen, float(np.sqrt(np.mean(_read(values, at) ** 2))))


def _read(values: Array, at: Array) -> Array:
    from scipy.ndimage import map_coordinates

    return map_coordinates(values, [at[:, 1], at[:, 0]], order=1, mode="nearest")


def _points(at: Array, leaning: Array, shape: tuple[int, int]) -> tuple:
    """Rows of the least squares of places and normals, every cell with points weighing the same."""
    from scipy.sparse import coo_matrix

    low = np.minimum(np.floor(at).astype(int), np.array(shape[::-1]) - 2)
    x, y = (at - low).T
    index = low[:, 1] * shape[1] + low[:, 0]
    corners = np.stack([index, index + 1, index + shape[1], index + shape[1] + 1], 1)  # [N, 4]
    value = np.stack([(1 - x) * (1 - y), x * (1 - y), (1 - x) * y, x * y], 1)
    out = np.stack([y - 1, 1 - y, -y, y], 1)
    up = np.stack([x - 1, -x, 1 - x, x], 1)
    weight = 1 / np.sqrt(np.bincount(index, minlength=shape[0] * shape[1])[index])
    parts, wanted = [], []
    for columns, target, strength in (
        (value, 0 * x, 1.0),
        (out, leaning[:, 0], DEFAULT.lean),
        (up, leaning[:, 1], DEFAULT.lean),
    ):
        parts.append(columns * (weight * strength)[:, None])
        wanted.append(target * weight * strength)
    rows = np.repeat(np.arange(3 * len(at)), 4)
    entries = np.concatenate(parts).ravel(), (rows, np.tile(corners, (3, 1)).ravel())
    return coo_matrix(entries, (3 * len(at), shape[0] * shape[1])).tocsr(), np.concatenate(wanted)


def _bending(shape: tuple[int, int]):
    """Quadratic form [n, n] of second differences of a grid, mirrored at the axis (the first column)."""
    from scipy.sparse import diags, eye, kron

    h, w = shape
    second = lambda n: diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(n - 2, n))  # noqa: E731
    first = lambda n: diags([-1.0, 1.0], [0, 1], shape=(n - 1, n))  # noqa: E731
    axis = diags([[-2.0], [2.0]], [0, 1], shape=(1, w))
    terms = [kron(eye(h), second(w)), kron(second(h), eye(w)), kron(eye(h), axis)]
    cross = kron(first(h), first(w))
    return sum(t.T @ t for t in terms) + 2 * cross.T @ cross
