"""The profile of a lathed body: where the half plane beside the axis is full, from points with normals on its border.

A function that is 0 on the border, negative in the body, and rises by one a cell, as smooth as the points allow (the
implicit surface of Turk and O'Brien 2002, on a grid): what no point tells goes on as it went.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import unit
from materialist.types import Array


@dataclass(frozen=True)
class ProfileSettings:
    """How smooth the function is, and how it goes on where nothing is seen; tuned by eye."""

    bend: float = 0.03  # weight of second differences against that of points: larger is smoother
    lean: float = 2.0  # weight of normals against that of places
    rounds: int = 3  # solutions; after each, places that rays pass freely and that lay in the body are pushed out
    pushed: float = 0.5  # value that such a place is given, cells
    push: float = 0.3  # its weight
    margin: int = 12  # cells around what is seen
    below: float = 3.0  # cells below the surface at which no ray passes
    gap: int = 7  # cells along a line without a point that are no gap in what is seen
    stretch: float = 0.2  # part of the height over which the outside is looked at, to go on below
    stretch_inside: float = 0.5  # the same for the inside of a ring
    meeting: float = 0.2  # part of the height within which a ring's inside must end at the foot of its outside
    level: float = 0.8  # angle from the level within which it must end, radians
    clear: float = 3.0  # cells around points that are seen in which no ray pushes: there the points tell the border
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
    through: float
    """Share of those points just below which rays pass freely."""

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
            normal = unit(np.where((line[:, 1] <= bottom + 1e-3)[:, None], [0.0, -1], self._slope(line)))
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


def fitted(seen: Array, leaning: Array, passed: Array, cell: float, floor: float) -> Profile:
    """The profile through points of its border.

    Args:
        seen: [N, 2] distance from the axis and height. leaning: [N, 2] unit normals there, outwards.
        passed: [M, 2] places that are free for certain.
        cell, floor: as of `Profile`.
    """
    first = _fitted(seen, leaning, len(seen), passed, cell, floor)
    below = _hidden(first, leaning, -1)
    foot = float(np.concatenate([seen, below[:, :2]])[:, 1].min())
    hidden = np.concatenate([below, _hidden(first, leaning, 1, foot)])
    if not len(hidden):
        return first
    turning = np.stack([np.cos(hidden[:, 2]), np.sin(hidden[:, 2])], -1)
    both = np.concatenate([seen, hidden[:, :2]]), np.concatenate([leaning, turning])
    return _fitted(*both, len(seen), passed, cell, floor)


def _fitted(points: Array, leaning: Array, count: int, passed: Array, cell: float, floor: float) -> Profile:
    """The profile of points of which the first `count` are seen."""
    from scipy.ndimage import distance_transform_edt
    from scipy.sparse import diags
    from scipy.sparse.linalg import splu

    seen = points[:count]
    low = min(float(seen[:, 1].min()), max(floor, float(seen[:, 1].min() - np.ptp(seen[:, 1])))) - DEFAULT.margin * cell
    shape = (
        int(np.ceil((seen[:, 1].max() - low) / cell)) + DEFAULT.margin,
        int(np.ceil(seen[:, 0].max() / cell)) + DEFAULT.margin,
    )
    at = lambda places: (places - [0, low]) / cell  # noqa: E731  (column, row)
    free = _cells(at(passed), shape)
    told = free & (distance_transform_edt(~_cells(at(seen), shape)) > DEFAULT.clear)
    rows, wanted = _points(at(points), leaning, shape)
    matrix = rows.T @ rows + DEFAULT.bend * _bending(shape)
    right = rows.T @ wanted
    pushed = np.zeros(shape, bool)
    for _ in range(DEFAULT.rounds):
        push = DEFAULT.push * pushed.ravel()
        values = splu((matrix + diags(push)).tocsc()).solve(right + DEFAULT.pushed * push).reshape(shape)
        before, pushed = pushed, pushed | (told & (values < DEFAULT.pushed / 2))
        if (before == pushed).all():
            break
    off = float(np.sqrt(np.mean(_read(values, at(seen)) ** 2)))
    below = np.clip(np.round(at(seen) - DEFAULT.below * leaning[:count]).astype(int), 0, np.array(shape[::-1]) - 1)
    return Profile(values, cell, low, floor, seen, off, float(free[below[:, 1], below[:, 0]].mean()))


def _hidden(profile: Profile, leaning: Array, way: int, foot: float = 0.0) -> Array:
    """Where the border goes on below what is seen of it: places and the angles of normals [K, 3].

    way -1: the outside, from the lowest that is seen, with the curvature above it, until the ground, or level. way 1:
    the inside of a ring, which goes on turning until it meets the `foot` of the outside, at that height and level; the
    inside of a cup does not, and stays as it is.
    """
    from scipy.ndimage import maximum_filter1d
    from scipy.spatial import cKDTree

    high, tree = np.ptp(profile.seen[:, 1]), cKDTree(profile.seen)
    for line, _ in profile.lines():
        away, nearest = tree.query(line)
        # Small gaps do not end what is seen.
        known = maximum_filter1d(away < DEFAULT.beside * profile.cell, DEFAULT.gap, mode="nearest")
        if way < 0:
            ends = np.flatnonzero(known & ~np.roll(known, 1) & (line[:, 1] < np.median(profile.seen[:, 1])))[:1]
        else:
            ends = np.flatnonzero(known & ~np.roll(known, -1) & (line[:, 1] > foot + DEFAULT.meeting * high))[-1:]
        if not len(ends) or line[ends[0], 0] < DEFAULT.gap * profile.cell:
            continue
        # The line from its end into what is seen, from a place with a point right there.
        back = np.s_[ends[0] :] if way < 0 else np.s_[ends[0] :: -1]
        start = int(np.argmax(away[back] < profile.cell))
        stretch = DEFAULT.stretch if way < 0 else DEFAULT.stretch_inside
        found = _onward(profile, line[back][start:], leaning[nearest[back][start:]], stretch, way)
        level = way < 0 or (len(found) > 1 and found[-1, 2] > 1.5 * np.pi - DEFAULT.level)
        if len(found) > 1 and level and (way < 0 or abs(found[-1, 1] - foot) < DEFAULT.meeting * high):
            return found[1:]
    return np.zeros((0, 3))


def _onward(profile: Profile, line: Array, leaning: Array, stretch: float, way: int) -> Array:
    """What lies before a line [K, 2] with normals [K, 2], a cell apart: places and the angles of normals [M, 3].

    It turns as the line's beginning does. way: 1 for a line that is to be followed with the body to the left, -1 for
    one with the body to the right; normals point right for -1, left for 1.
    """
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    part = along < stretch * np.ptp(profile.seen[:, 1])
    angle = np.unwrap(np.arctan2(leaning[part, 1], leaning[part, 0]))
    middle = 0.0 if way < 0 else np.pi
    angle += 2 * np.pi * np.round((middle - angle[0]) / (2 * np.pi))
    if part.sum() < DEFAULT.gap or abs(angle[0] - middle) > np.pi / 2:
        return np.zeros((0, 3))
    rate, first = np.polyfit(along[part], angle, 1)
    rate, at, found = -way * rate, line[0].copy(), []
    while rate > 0 and at[0] > 0 and at[1] > profile.floor and abs(first - middle) < np.pi / 2:
        found.append([*at, first])
        first += way * rate * profile.cell
        at = at + way * profile.cell * np.array([-np.sin(first), np.cos(first)])
    return np.array(found).reshape(-1, 3)


def _read(values: Array, at: Array) -> Array:
    from scipy.ndimage import map_coordinates

    return map_coordinates(values, [at[:, 1], at[:, 0]], order=1, mode="nearest")


def _cells(at: Array, shape: tuple[int, int]) -> Array:
    """[h, w] bool: cells with one of the places [M, 2] (column, row)."""
    column, row = np.round(at).astype(int).T
    there = (row >= 0) & (row < shape[0]) & (column < shape[1])
    found = np.zeros(shape, bool)
    found[row[there], column[there]] = True
    return found


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
    told = (value, 0 * x, 1.0), (out, leaning[:, 0], DEFAULT.lean), (up, leaning[:, 1], DEFAULT.lean)
    for columns, target, strength in told:
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
