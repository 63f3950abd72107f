"""The visible front of one object, smooth enough to bend light: depth and predicted normals joined."""

from __future__ import annotations

import numpy as np

from materialist.geometry.ridges import blurred_normals
from materialist.geometry.slopes import Pairs, between, least_squares_change, slopes
from materialist.solids.symmetry import border_distance, spacing
from materialist.types import Array

REACH = 0.25
"""Depth decides over lengths above this part of the object's size, normals below. Networks give the slant of a surface
better than its relief, which is flat and noisy; where both are exact they agree."""
SLACK = 1.0
"""A step of the depth is right between the slopes that the normals at its ends demand, and beyond them by this part of
their difference: on a curved surface, and across an edge, the mean of the two is not what the depth does."""
STEEPEST, JUMP = 0.05, 1.5
"""Smallest n.v that is followed (3 degrees), and how much steeper than that a step joins no surface."""
EXACT, MOST = 1e-3, 0.5
"""A step of the depth is what its normals demand to this part of a pixel; where more than this share of all steps are
(predicted maps: a twentieth at most), depth and normals are of one surface, and stay wherever they agree."""
RIM = 1.5
"""Pixels from the silhouette whose depth is not believed: there a depth map mixes the object with what is behind."""


def smooth_front(depth: Array, normal: Array, inside: Array, rays: Array, *, smooth: float = 0.01) -> Array:
    """Planar depth of the object's front, with the slopes of the normals.

    Solves min over z of |grad log z - g|^2 + |log z - log depth|^2 / (REACH size)^2 inside the mask, where g is a
    slope that the normals allow: n . d(z r) = 0 gives d log z = -n . dr / (n . r) at both ends of a step, and what
    the depth itself does stands where it is near that. So exact maps stay as they are, and noise goes.

    Args:
        depth: [H, W] planar, scene units. normal: [H, W, 3] unit. inside: [H, W] bool, where both are known.
        rays: [H, W, 3] through the pixels at z = -1, evenly spaced.
        smooth: standard deviation of the blur of the normals, as a part of the object's size (root of its area).

    Returns:
        [H, W] float64, scene units; `depth` outside the mask.
    """
    size = float(np.sqrt(inside.sum()))
    if inside.sum() < 9:
        return np.asarray(depth, np.float64)
    pairs = _pairs(depth, normal, inside, rays, smooth)
    pull = np.where(border_distance(inside)[inside] > RIM, 1.0, 0.02) / (REACH * size) ** 2 + 1e-9
    if _agree(pairs, rays):
        pull = pull + _settled(pairs, len(pull), rays)
    change = least_squares_change(*pairs, pull, rtol=1e-4, maxiter=500)
    out = np.asarray(depth, np.float64).copy()
    out[inside] = depth[inside] * np.exp(np.clip(change, -0.5, 0.5))
    return out


def of_one_surface(depth: Array, normal: Array, inside: Array, rays: Array) -> bool:
    """Whether most steps of the depth are what the normals demand, as in exact maps; arguments of `smooth_front`."""
    return inside.sum() >= 9 and _agree(_pairs(depth, normal, inside, rays, 0.0), rays)


def _agree(pairs: Pairs, rays: Array) -> bool:
    return len(pairs[2]) > 0 and float((np.abs(pairs[2]) <= EXACT * spacing(rays)).mean()) > MOST


def _settled(pairs: Pairs, count: int, rays: Array) -> Array:
    """[N] 1 for pixels all of whose steps are what the normals demand, else 0."""
    first, second, wanted, _ = pairs
    other = np.abs(wanted) > EXACT * spacing(rays)
    moved = np.concatenate([first[other], second[other]])
    return (np.bincount(moved, minlength=count) == 0).astype(np.float64)


def _pairs(depth: Array, normal: Array, inside: Array, rays: Array, smooth: float) -> Pairs:
    """Linked neighbours [P]: their unknowns, the step wanted on top of the depth's own, and its weight."""
    blurred = blurred_normals(normal, inside, smooth * float(np.sqrt(inside.sum())))
    demanded = slopes(blurred, rays, STEEPEST)
    log_depth = np.log(np.where(inside, depth, 1).astype(np.float64))
    index = np.cumsum(inside.ravel()).reshape(inside.shape) - 1
    cliff = JUMP / STEEPEST * spacing(rays)  # no surface is steeper
    parts = []
    for slope, (near, far, midway) in zip(demanded, between(demanded), strict=True):
        both = inside[near] & inside[far]
        own, asked = (log_depth[far] - log_depth[near])[both], midway[both]
        room = (0.5 + SLACK) * np.abs(slope[far] - slope[near])[both]
        # Where the depth jumps, one part of the object hides another, and no slope joins them.
        jump = np.abs(own) > np.minimum(np.maximum(6 * np.abs(asked), 0.05), cliff)
        change = np.where(jump, 0, np.clip(own, asked - room, asked + room) - own)
        parts.append((index[near][both], index[far][both], change, np.where(jump, 1e-3, 1.0)))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*parts))
    return first, second, wanted, weight
