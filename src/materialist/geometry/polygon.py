"""Convex polygons in a plane: clipping by half-planes, and triangles small enough to carry varying radiance."""

from __future__ import annotations

import numpy as np

from materialist.types import Array


def clip(polygon: Array, line: Array) -> Array:
    """The part of a convex polygon [N, 2] where line [3] holds: a x + b y + c >= 0. May be empty, [0, 2]."""
    if not len(polygon):
        return polygon
    value = polygon @ line[:2] + line[2]  # [N]
    after = np.roll(np.arange(len(polygon)), -1)
    kept = []
    for i, j in enumerate(after):
        if value[i] >= 0:
            kept.append(polygon[i])
        if (value[i] >= 0) != (value[j] >= 0):
            kept.append(polygon[i] + (polygon[j] - polygon[i]) * (value[i] / (value[i] - value[j])))
    return np.array(kept).reshape(-1, 2) if len(kept) > 2 else np.zeros((0, 2))


def triangulate(polygon: Array, centre: Array, smallest: float, growth: float, most: int) -> Array:
    """[T, 3, 2] triangles that tile a convex polygon [N, 2], in its own winding, finer near `centre` [2].

    An edge is at most max(smallest, growth * distance of the triangle from the centre) long, unless that would take
    more than `most` triangles. Units of the polygon.
    """
    if len(polygon) < 3:
        return np.zeros((0, 3, 2))
    fan = np.arange(1, len(polygon) - 1)
    triangles = np.stack([np.broadcast_to(polygon[0], (len(fan), 2)), polygon[fan], polygon[fan + 1]], 1)
    while len(triangles) < most:
        edge = np.linalg.norm(np.roll(triangles, -1, 1) - triangles, axis=-1)  # [T, 3] edge k runs from k to k + 1
        distance = np.linalg.norm(triangles.mean(1) - centre, axis=-1)
        large = edge.max(1) > np.maximum(smallest, growth * distance)
        if not large.any():
            break
        order = (edge[large].argmax(1)[:, None] + np.arange(3)) % 3  # the longest edge first
        a, b, c = np.take_along_axis(triangles[large], order[..., None], 1).transpose(1, 0, 2)
        middle = (a + b) / 2
        halves = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
        triangles = np.concatenate([triangles[~large], halves])
    return triangles
