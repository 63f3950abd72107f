"""The visible front of one object, smooth enough to bend light: depth and predicted normals joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.geometry.silhouette import border_distance, spacing
from materialist.geometry.slopes import Pairs, between, blurred_normals, least_squares_change, slopes
from materialist.types import Array


@dataclass(frozen=True)
class FrontSettings:
    """What of a front is believed of its depth, what of its normals."""

    reach: float = 0.25  # part of the object's size above which depth decides, below it normals; tuned by eye
    slack: float = 1.0  # part of the difference of two slopes by which a step may leave the range between them
    steepest: float = 0.05  # smallest n.v that is followed (3 degrees)
    jump: float = 1.5  # a step steeper than `steepest` by this factor joins no surface
    rim: float = 1.5  # pixels from the silhouette whose depth is a mixture with what is behind, and hardly counts
    rim_weight: float = 0.02  # weight of that depth
    smooth: float = 0.01  # standard deviation of the blur of the normals, part of the object's size; tuned by eye


DEFAULT = FrontSettings()


def smooth_front(depth: Array, normal: Array, inside: Array, rays: Array, *, smooth: float = DEFAULT.smooth) -> Array:
    """Planar depth of the object's front, with the slopes of the normals.

    Solves min over z of |grad log z - g|^2 + |log z - log depth|^2 / (reach size)^2 inside the mask. g is the slope of
    the depth where it lies near those that the normals at both ends of a step demand, else the nearest of these
    (n . d(z r) = 0 gives d log z = -n . dr / (n . r)): edges keep their place, and noise goes.

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
    pairs = _pairs(depth, blurred_normals(normal, inside, smooth * size), inside, rays)
    believed = border_distance(inside)[inside] > DEFAULT.rim
    pull = np.where(believed, 1.0, DEFAULT.rim_weight) / (DEFAULT.reach * size) ** 2 + 1e-9
    change = least_squares_change(*pairs, pull, rtol=1e-4, maxiter=500)
    out = np.asarray(depth, np.float64).copy()
    out[inside] = depth[inside] * np.exp(np.clip(change, -0.5, 0.5))
    return out


def _pairs(depth: Array, normal: Array, inside: Array, rays: Array) -> Pairs:
    """Linked neighbours [P]: their unknowns, the step wanted on top of the depth's own, and its weight."""
    demanded = slopes(normal, rays, DEFAULT.steepest)
    log_depth = np.log(np.where(inside, depth, 1).astype(np.float64))
    index = np.cumsum(inside.ravel()).reshape(inside.shape) - 1
    cliff = DEFAULT.jump / DEFAULT.steepest * spacing(rays)  # no surface is steeper
    parts = []
    for slope, (near, far, midway) in zip(demanded, between(demanded), strict=True):
        both = inside[near] & inside[far]
        own, asked = (log_depth[far] - log_depth[near])[both], midway[both]
        room = (0.5 + DEFAULT.slack) * np.abs(slope[far] - slope[near])[both]
        # Where the depth jumps, one part of the object hides another, and no slope joins them.
        jump = np.abs(own) > np.minimum(np.maximum(6 * np.abs(asked), 0.05), cliff)
        change = np.where(jump, 0, np.clip(own, asked - room, asked + room) - own)
        parts.append((index[near][both], index[far][both], change, np.where(jump, 1e-3, 1.0)))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*parts))
    return first, second, wanted, weight
