"""Edges of objects between the pixels: where two faces meet, each keeps its own normals and its own plane.

Normals that are blended over an edge bend light as neither face does: a bright line in glass. The edge itself runs
between the pixels, where the planes of its two sides have the same depth.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from materialist.solids.symmetry import spacing
from materialist.types import Array

CREASE = 60.0
"""Angle between the normals of two pixels, degrees, from which they lie on different faces: small round things turn by
40 degrees from one pixel to the next."""
REACH = 3
"""Pixels around an edge within which splines would swing: places there get means of their neighbours instead."""
WIDEST = 6
"""Reach, pixels, of the blur next to edges: it costs time by its square, and edges may be everywhere."""
SAME = 1e-4
"""Part of a pixel's size by which a pixel lies off a plane at most that goes through it."""
FARTHEST = 3.0
"""Pixels by which a plane may take the depth away from that of the pixels around a place."""
_CORNERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1]])
"""[4, 2] (x, y) from the upper left pixel around a place to all four."""


class Sided(NamedTuple):
    """What a surface is at some places near edges."""

    number: Array
    """[K] which places."""
    depth: Array
    """[K] planar, scene units."""
    normal: Array
    """[K, 3] unit."""


def edges(normal: Array, inside: Array, crease: float = CREASE) -> Array:
    """[H, W] bool: pixels inside with a neighbour inside whose normal differs by more than `crease` degrees."""
    found, limit = np.zeros(inside.shape, bool), np.cos(np.radians(crease))
    for near, far in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        apart = inside[near] & inside[far] & ((normal[near] * normal[far]).sum(-1) < limit)
        found[near] |= apart
        found[far] |= apart
    return found


def blurred_normals(normal: Array, inside: Array, sigma: float, crease: float = CREASE) -> Array:
    """[H, W, 3] unit: the Gaussian mean of those inside nearby that lie on the same face.

    sigma: pixels; below 0.1 the normals stay as they are.
    """
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    unit = np.where(inside[..., None], normal, 0).astype(np.float64)
    if sigma <= 0.1:
        return _unit(unit)
    mixed = gaussian_filter(unit, (sigma, sigma, 0))
    sharp = edges(unit, inside, crease)
    if not sharp.any():
        return _unit(mixed)
    near = inside & (distance_transform_edt(~sharp) <= 4 * sigma)  # as far as the other blur reaches
    reach = min(int(np.ceil(2.5 * sigma)), WIDEST)
    sigma = min(sigma, reach / 2.5)
    rows, columns = np.nonzero(near)
    own, total = unit[near], np.zeros((len(rows), 3))
    framed, limit = np.pad(unit, ((reach, reach), (reach, reach), (0, 0))), np.cos(np.radians(crease))
    for dy in range(2 * reach + 1):
        for dx in range(2 * reach + 1):
            other = framed[rows + dy, columns + dx]
            weight = np.exp(-((dy - reach) ** 2 + (dx - reach) ** 2) / (2 * sigma**2))
            total += weight * other * ((other * own).sum(-1, keepdims=True) > limit)
    mixed[near] = total
    return _unit(mixed)


def at_edges(depth: Array, normal: Array, known: Array, rays: Array, place: Array, crease: float = CREASE) -> Sided:
    """A surface at those of the places that are near edges, each with the face it lies on.

    Of a body that bulges the true surface is behind the tangent plane of every face: where faces meet, the farthest
    plane of the front is the surface, and the nearest one of the back. In a hollow it is the other way round. Which of
    the two an edge is the pixels beside it tell.

    Args:
        depth: [h, w] planar, scene units. normal: [h, w, 3] unit. known: [h, w] bool.
        rays: [h, w, 3] through the pixels at z = -1, evenly spaced. place: [V, 2] (x, y) pixels.
    """
    from scipy.ndimage import binary_dilation

    sharp = edges(normal, known, crease)
    if not sharp.any():
        return Sided(np.zeros(0, int), np.zeros(0), np.zeros((0, 3)))
    first = np.floor(place).astype(int)
    pixels = first[:, None] + _CORNERS  # [V, 4, 2]
    height, width = known.shape
    there = ((pixels >= 0) & (pixels < [width, height])).all((-1, -2))
    near = binary_dilation(sharp, iterations=REACH)
    column, row = np.clip(pixels, 0, [width - 1, height - 1]).transpose(2, 0, 1)
    number = np.flatnonzero(there & known[row, column].all(-1) & near[row, column].any(-1))
    column, row = column[number], row[number]
    part = place[number] - first[number]
    weight = np.abs(1 - _CORNERS - part[:, None]).prod(-1)  # [K, 4] bilinear
    own, z = normal[row, column], depth[row, column]  # [K, 4, 3], [K, 4]
    ray = (weight[..., None] * rays[row, column]).sum(1)  # [K, 3]
    points = z[..., None] * rays[row, column]  # [K, 4, 3]
    pixel, limit = spacing(rays), np.cos(np.radians(crease))
    planes = _on_planes(own, points, ray[:, None], z, pixel)  # [K, 4] depth of each pixel's plane at the place
    side, edge, jump = _face(own, points, z, planes, weight, rays[row, column], limit, pixel)
    alike = (own * np.take_along_axis(own, side[:, None, None], 1)).sum(-1) > limit
    share = np.where(alike, np.maximum(weight, 1e-3), 0)
    known_side = (own * own).sum(-1).min(-1) > 0.5  # a pixel without a normal lies on no face
    share /= np.maximum(share.sum(-1, keepdims=True), 1e-9)
    kept = known_side & ~jump
    found = np.where(edge, (share * planes).sum(-1), 1 / (weight / z).sum(-1))  # 1/z is linear on planes
    return Sided(number[kept], found[kept], _unit((share[..., None] * own).sum(1))[kept])


def _face(own, points, z, planes, weight, rays, limit: float, pixel: float) -> tuple[Array, Array, Array]:
    """[K] which of four pixels a place shares its face with; [K] whether they lie on several that meet there; [K]
    whether one of them hides another instead: then each is behind the other's plane on one side only."""
    bulge, jump = np.zeros(len(own)), np.zeros(len(own), bool)
    for i, j in combinations(range(4), 2):
        apart = (own[:, i] * own[:, j]).sum(-1) < limit
        steps = []
        for a, b in ((i, j), (j, i)):
            step = z[:, b] / _on_planes(own[:, a], points[:, a], rays[:, b], z[:, a], pixel) - 1
            steps.append(np.where(np.abs(step) > SAME * pixel, np.sign(step), 0))  # 0: a pixel on the edge itself
        bulge += np.where(apart, steps[0] + steps[1], 0)
        jump |= apart & (steps[0] * steps[1] < 0)
    edge = (bulge != 0) & ~jump
    order = np.where(bulge[:, None] >= 0, planes, -planes)
    return np.where(edge, order.argmax(-1), weight.argmax(-1)), edge, jump


def _on_planes(normal: Array, point: Array, ray: Array, own: Array, pixel: float) -> Array:
    """[...] planar depth at which rays (z = -1) meet the planes through points of depth `own`, not far from that."""
    facing = (normal * ray).sum(-1)
    found = (normal * point).sum(-1) / np.where(np.abs(facing) > 1e-9, facing, 1e-9)
    far = FARTHEST * pixel
    return np.clip(np.where(found > 0, found, own), (1 - far) * own, (1 + far) * own)


def _unit(v: Array) -> Array:
    return v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-9)
