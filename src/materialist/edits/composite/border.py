"""Where the border of a mask runs in the photo: the smoothest path, near the mask's own, that parts two colours."""

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree
from skimage.measure import find_contours

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import Box, window
from materialist.geometry.slopes import sampled
from materialist.types import Array


@dataclass(frozen=True)
class BorderSettings:
    """Lengths in working pixels; tuned on ten composites, and on 49 outlined objects of photos, whose halves agree."""

    reach: float = 2.5  # by which the border may move
    side: float = 1.5  # beyond the reach, up to which colours on both sides count
    step: float = 0.25  # between offsets that are compared
    spacing: float = 1.0  # between points of the border
    finest: float = 4.0  # grid points a working pixel, at most; derived: time
    # standard deviation of an even surface's colour, sRGB-encoded, channels added
    grain: float = 0.03
    # cost of a change of offset between two points, and of an offset: per square pixel, against a logarithm of variance
    bend: float = 50.0
    away: float = 0.2
    # standard deviation, points, of the Gaussian that takes steps out of lines and offsets
    smooth: float = 1.5
    # points of the border whose offsets a pixel takes, by inverse square distance
    neighbours: int = 4


SETTINGS = BorderSettings()
BEYOND = 100.0
"""Cost of a pixel beyond the limit of an offset: more than any edge is worth."""


def on_edges(distance: Array, photo: Array, reach: float) -> Array:
    """[H, W] signed distance to a border, once it has moved to the photo's edges; working pixels, > 0 inside.

    Along the normals of the border, each offset parts the photo's colours into two sides; the variance within the
    sides is least at an edge. Dynamic programming finds the offsets of least cost along the whole border.

    distance: [H, W] to the mask's own border. photo: [H0, W0, 3] linear. reach: up to which distance counts.
    """
    near = np.abs(distance) < reach
    if not near.any() or min(distance.shape) < 3:
        return distance
    # --- The photo around the border, on a grid that is fine enough ---
    box = window(near, margin=int(np.ceil(2 * SETTINGS.reach)) + 1)
    seen = _Seen(photo, box, distance.shape)
    # --- Each stretch of the border by itself ---
    field = distance[box]
    slopes = np.gradient(cv2.GaussianBlur(field, (0, 0), 1.0))
    points: list[Array] = []
    offsets: list[Array] = []
    for line in find_contours(field, 0.0):
        stretch, closed = _resampled(line)
        points.append(stretch)
        if len(stretch) < 3:
            offsets.append(np.zeros(len(stretch)))
            continue
        # Its steps of whole pixels are no shape.
        ends = "wrap" if closed else "nearest"
        even = gaussian_filter1d(stretch, SETTINGS.smooth, axis=0, mode=ends)
        normal = -np.stack([_looked_up(slope, even) for slope in slopes], -1)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
        limit = _limit(field, even, normal)
        offset = _offsets(seen, even, normal, limit, closed)
        # The steps between offsets are taken out, too.
        offset = gaussian_filter1d(offset, SETTINGS.smooth, mode=ends)
        offset = offset + ((even - stretch) * normal).sum(-1)
        offsets.append(np.clip(offset, -limit, limit))
    if not points:
        return distance
    # --- From the border's points to pixels ---
    places = np.argwhere(near[box])
    tree = cKDTree(np.concatenate(points))
    count = min(SETTINGS.neighbours, tree.n)
    apart, nearest = tree.query(places, k=[*range(1, count + 1)])
    weight = 1 / (apart + 0.5) ** 2
    shift = (np.concatenate(offsets)[nearest] * weight).sum(-1) / weight.sum(-1)
    moved = distance.copy()
    moved[box][tuple(places.T)] += shift.astype(np.float32)
    return moved


class _Seen:
    """A box of working pixels of a photo [H0, W0, 3] linear, sRGB-encoded, on a grid that is fine enough."""

    def __init__(self, photo: Array, box: Box, shape: tuple[int, ...]):
        scale = np.array(photo.shape[:2]) / shape  # native pixels a working pixel
        first = np.array([side.start for side in box])
        last = np.array([side.stop for side in box])
        # --- Whole native pixels that hold the box ---
        start = np.floor(first * scale).astype(int)
        stop = np.minimum(np.ceil(last * scale).astype(int), photo.shape[:2])
        fine = min(max(1.0, float(scale.max())), SETTINGS.finest)
        size = np.maximum(2, np.round((last - first) * fine).astype(int))
        part = np.asarray(photo[start[0] : stop[0], start[1] : stop[1]], np.float32)
        small = cv2.resize(part, size[::-1].tolist(), interpolation=cv2.INTER_AREA)
        self._picture = linear_to_srgb(np.clip(small, 0, 1)).astype(np.float32)
        # --- From places in the box to those on the grid ---
        finer = size / (stop - start)
        self._factor = scale * finer
        self._shift = (first * scale - start) * finer

    def colours(self, places: Array) -> Array:
        """[..., 3] at places [..., 2] (row, column) in the box, working pixels, pixel centres at whole numbers."""
        return _looked_up(self._picture, (places + 0.5) * self._factor + self._shift - 0.5)


def _limit(field: Array, points: Array, normal: Array) -> Array:
    """[N] working pixels by which points may move: half as far as what is on either side is deep, within the reach.

    Else the two borders of a thin thing, or of a gap, would cross. field: [h, w] signed distance.
    """
    along = np.arange(0, 2 * SETTINGS.reach + 1, 0.5)
    depth = np.inf
    for side in (-1, 1):
        places = points[:, None] + side * along[:, None] * normal[:, None]
        depth = np.minimum(depth, (-side * _looked_up(field, places)).max(-1))
    return np.clip(depth / 2, 0, SETTINGS.reach)


def _resampled(line: Array) -> tuple[Array, bool]:
    """Points [N, 2] (row, column) of a line [M, 2] at even spacing, none twice, and whether it is closed."""
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=-1))])
    closed = bool((line[0] == line[-1]).all())
    count = int(length[-1] / SETTINGS.spacing) + 1
    places = np.linspace(0, length[-1], count, endpoint=not closed)
    return np.stack([np.interp(places, length, line[:, k]) for k in (0, 1)], -1), closed


def _looked_up(picture: Array, places: Array) -> Array:
    """Bilinear values [..., C] of a picture [h, w] or [h, w, C] at places [..., 2] (row, column)."""
    values = sampled(picture, places.reshape(-1, 2)[:, ::-1], order=1)
    return values.reshape(*places.shape[:-1], *picture.shape[2:])


def _offsets(seen: _Seen, points: Array, normal: Array, limit: Array, closed: bool) -> Array:
    """[N] working pixels, outwards, by which the border moves at its points [N, 2] along normals [N, 2].

    limit: [N] the most that it may move.
    """
    # --- Colours along the normals: [N, K, 3] ---
    most = round(SETTINGS.reach / SETTINGS.step)
    side = round(SETTINGS.side / SETTINGS.step)
    # Samples lie between the offsets, each on one side of any border.
    along = SETTINGS.step * (np.arange(-most - side, most + side) + 0.5)
    places = points[:, None] + normal[:, None] * along[:, None]
    colours = seen.colours(places)
    colours = cv2.GaussianBlur(colours, (1, 3), 0, sigmaY=1.0, borderType=cv2.BORDER_REPLICATE)
    # --- Variance within both sides, for each offset ---
    sums = np.cumsum(np.pad(colours, ((0, 0), (1, 0), (0, 0))), 1)
    squares = np.cumsum(np.pad((colours**2).sum(-1), ((0, 0), (1, 0))), 1)
    cut = side + np.arange(2 * most + 1)
    count = len(along)
    inner = sums[:, cut]
    outer = sums[:, -1:] - inner
    within = squares[:, -1:] - (inner**2).sum(-1) / cut - (outer**2).sum(-1) / (count - cut)
    offset = SETTINGS.step * np.arange(-most, most + 1)
    # --- The path of least cost ---
    variance = np.maximum(within, 0) / count + SETTINGS.grain**2
    too_far = np.maximum(np.abs(offset) - limit[:, None], 0)
    cost = np.log(variance) + SETTINGS.away * offset**2 + BEYOND * too_far
    path = _least_path(cost, SETTINGS.bend * SETTINGS.step**2, closed)
    return offset[path]


def _least_path(cost: Array, bend: float, closed: bool) -> Array:
    """[N] columns of least cost [N, K] + bend (change of column)^2, changes of at most 3; N as the first if closed."""
    count, columns = cost.shape
    start = 0
    if closed:
        # The path begins and ends where it is surest.
        start = int((cost.min(1) - cost.mean(1)).argmin())
        cost = np.concatenate([np.roll(cost, -start, axis=0), cost[start : start + 1]])
        pinned = np.arange(columns) != cost[0].argmin()
        cost[[0, -1]] += np.where(pinned, 1e6, 0)
    # --- Forwards: the least cost of a path that ends in each column ---
    changes = np.arange(-3, 4)[:, None]
    penalty = bend * changes**2
    came_from = np.arange(columns) + changes  # [7, K] column before, by the change
    best = cost[0]
    before = np.zeros(cost.shape, int)
    for row in range(1, len(cost)):
        padded = np.pad(best, 3, constant_values=np.inf)
        ways = padded[came_from + 3] + penalty
        change = ways.argmin(0)
        before[row] = came_from[change, np.arange(columns)]
        best = ways[change, np.arange(columns)] + cost[row]
    # --- Backwards along the best of them ---
    path = np.empty(len(cost), int)
    path[-1] = best.argmin()
    for row in range(len(cost) - 1, 0, -1):
        path[row - 1] = before[row, path[row]]
    return np.roll(path[:count], start)
