"""Depth with the relief of the normals: smooth where the network saw one surface, broken where it saw two.

Medians that put edges where the photo has them also print the photo's texture onto every slope, and a mesh of that
shades itself with tiny steps.
"""

from __future__ import annotations

import cv2
import numpy as np

from materialist.geometry.slopes import Pairs, between, least_squares_change, slopes
from materialist.types import Array

STEP = (0.02, 0.05)
"""Change of log depth within reach, beyond that of the slopes, that is surely none, and surely an edge."""
BREAK = 0.008
"""Change of log depth from pixel to pixel, beyond that of the slopes, that may be left open where there is an edge."""
PART = 0.12
"""Part of the whole change within reach that one such pair must have: an edge is one step, print of texture is many."""
OPEN = 1e-3
"""Weight of such a pair of pixels."""
LENGTH = 10.0
"""Pixels above which the depth decides, below which the normals do."""


def with_relief(coarse: Array, sharp: Array, normal: Array, rays: Array, *, reach: int) -> Array:
    """Logarithm of depth that follows the normals in the small, `sharp` at edges, `coarse` elsewhere.

    Solves min over u of sum of w |u_q - u_p - g_pq|^2 over neighbours + sum |u_p - target_p|^2 / LENGTH^2, where g is
    the slope that the normals demand: n . d(z r) = 0 gives d log z = -n . dr / (n . r).

    Args:
        coarse: [H, W] logarithm of depth as the network gives it, NaN where there is no surface; without edges.
        sharp: [H, W] the same with edges.
        normal: [H, W, 3] unit. rays: [H, W, 2] x and y of the rays at z = -1.
        reach: pixels by which an edge of `coarse` may be off, or blurred.

    Returns:
        [H, W] float32, NaN where `coarse` is.
    """
    known = np.isfinite(coarse) & np.isfinite(sharp)
    if known.sum() < 9:
        return sharp
    demanded = slopes(normal, rays)
    change = excess(coarse, known, demanded, reach)
    edge = np.clip((change - STEP[0]) / (STEP[1] - STEP[0]), 0, 1) ** 2
    target = np.where(known, edge * np.nan_to_num(sharp) + (1 - edge) * np.nan_to_num(coarse), 0).astype(np.float64)
    index = np.cumsum(known.ravel()).reshape(known.shape) - 1
    pairs = _pairs(known, index, target, demanded, change)
    moved = least_squares_change(*pairs, np.full(int(known.sum()), LENGTH**-2), rtol=1e-3, maxiter=100)
    found = np.full(coarse.shape, np.nan, np.float32)
    found[known] = target[known] + moved
    return found


def excess(coarse: Array, known: Array, demanded: tuple[Array, Array], reach: int) -> Array:
    """[H, W] change of log depth within reach of a pixel, along a row or a column, that the normals do not explain.

    Infinite next to where the surface ends, whose outline stays as it is.
    """
    most = np.zeros(coarse.shape, np.float32)
    windows = (2 * reach + 1, 1), (1, 2 * reach + 1)
    for window, (near, far, asked) in zip(windows, between(demanded), strict=True):
        own = np.zeros(coarse.shape, np.float32)
        both = known[near] & known[far]
        own[near] = np.where(both, coarse[far] - coarse[near] - asked, 0)
        within = np.abs(cv2.boxFilter(own, -1, window, normalize=False, borderType=cv2.BORDER_CONSTANT))
        most = np.maximum(most, within)
    ending = cv2.dilate((~known).astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    return np.where(ending, np.inf, most).astype(np.float32)


def _pairs(known: Array, index: Array, target: Array, demanded: tuple[Array, Array], change: Array) -> Pairs:
    """Linked neighbours [P]: their unknowns, the step wanted on top of the target's own, and its weight."""
    parts = []
    for near, far, asked in between(demanded):
        both = known[near] & known[far]
        wanted = (asked - (target[far] - target[near]))[both]
        around = np.minimum(change[near], change[far])[both]
        least = np.where(np.isinf(around), BREAK, np.maximum(BREAK, PART * around))
        broken = (around > sum(STEP) / 2) & (np.abs(wanted) > least)
        parts.append((index[near][both], index[far][both], wanted, np.where(broken, OPEN, 1.0)))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    return first, second, wanted, weight
