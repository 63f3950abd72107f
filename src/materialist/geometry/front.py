"""The visible front of one object, smooth enough to bend light: depth and predicted normals joined."""

from __future__ import annotations

import numpy as np

from materialist.geometry.ridges import blurred_normals
from materialist.geometry.slopes import Pairs, between, least_squares_change, slopes
from materialist.geometry.symmetry import border_distance
from materialist.types import Array

REACH = 0.25
"""Depth decides over lengths above this part of the object's size, normals below. Networks give the slant of a surface
better than its relief, which is flat and noisy; where both are exact they agree."""
SLACK = 1.0
"""A step of the depth is right between the slopes that the normals at its ends demand, and beyond them by this part of
their difference: on a curved surface, and across an edge, the mean of the two is not what the depth does."""
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
    demanded = slopes(blurred_normals(normal, inside, smooth * size), rays)
    log_depth = np.log(np.where(inside, depth, 1).astype(np.float64))
    index = np.cumsum(inside.ravel()).reshape(inside.shape) - 1
    pull = np.where(border_distance(inside)[inside] > RIM, 1.0, 0.02) / (REACH * size) ** 2 + 1e-9
    change = least_squares_change(*_pairs(inside, index, log_depth, demanded), pull, rtol=1e-4, maxiter=500)
    out = np.asarray(depth, np.float64).copy()
    out[inside] = np.exp(log_depth[inside] + np.clip(change, -0.5, 0.5))
    return out


def _pairs(inside: Array, index: Array, log_depth: Array, demanded: tuple[Array, Array]) -> Pairs:
    """Linked neighbours [P]: their unknowns, the step wanted on top of the depth's own, and its weight."""
    parts = []
    for slope, (near, far, midway) in zip(demanded, between(demanded), strict=True):
        both = inside[near] & inside[far]
        own, asked = (log_depth[far] - log_depth[near])[both], midway[both]
        room = (0.5 + SLACK) * np.abs(slope[far] - slope[near])[both]
        # Where the depth jumps, one part of the object hides another, and no slope joins them.
        jump = np.abs(own) > np.maximum(6 * np.abs(asked), 0.05)
        change = np.where(jump, 0, np.clip(own, asked - room, asked + room) - own)
        parts.append((index[near][both], index[far][both], change, np.where(jump, 1e-3, 1.0)))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*parts))
    return first, second, wanted, weight
