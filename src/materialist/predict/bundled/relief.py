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
LEAST_PATCH = 40
"""Pixels below which a patch that stands out all around is print of texture, no surface of its own."""
ROUNDS = 8
"""How often such patches are sought: joined to what is around it, one may leave another."""
ONE_SIDED = 0.8
"""Share of a patch's outline that must step the same way, less that which steps the other way."""
BLURRED = 0.4
"""Part of the reach over which the network's edges are blurred."""
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
    pairs = _pairs(known, target, demanded, change)
    moved = least_squares_change(*pairs, np.full(int(known.sum()), LENGTH**-2), rtol=1e-3, maxiter=100)
    found = np.full(coarse.shape, np.nan, np.float32)
    found[known] = target[known] + moved
    return found


def smooth_relief(coarse: Array, normal: Array, rays: Array, *, length: float) -> Array:
    """Logarithm of depth [H, W] that follows the normals over less than `length` pixels, `coarse` over more.

    No edge is left open, so that what `coarse` has of edges is what the two differ in. Arguments as of `with_relief`.
    """
    known = np.isfinite(coarse)
    target = np.where(known, coarse, 0).astype(np.float64)
    first, second, wanted = (
        np.concatenate(column) for column in zip(*_linked(known, target, slopes(normal, rays)), strict=True)
    )
    pull = np.full(int(known.sum()), length**-2)
    moved = least_squares_change(first, second, wanted, np.ones(len(first)), pull, rtol=1e-2, maxiter=60)
    found = np.full(coarse.shape, np.nan, np.float32)
    found[known] = target[known] + moved
    return found


def excess(coarse: Array, known: Array, demanded: tuple[Array, Array], reach: int) -> Array:
    """[H, W] step of log depth within reach of a pixel, along a row or a column, that the normals do not explain.

    A step is what changes more over BLURRED of the reach than over all of it: a floor whose predicted normal is a
    little off changes everywhere alike, and has no edge. Infinite next to where the surface ends, whose outline stays
    as it is.
    """
    most = np.zeros(coarse.shape, np.float32)
    near_by, whole = 2 * max(1, round(BLURRED * reach)) + 1, 2 * reach + 1
    for axis, (near, far, asked) in enumerate(between(demanded)):
        own, there = np.zeros((2, *coarse.shape), np.float32)
        there[near] = known[near] & known[far]
        own[near] = np.where(there[near], coarse[far] - coarse[near] - asked, 0)
        within, pairs = (_totals(x, near_by, axis) for x in (own, there))
        around, all_pairs = (_totals(x, whole, axis) for x in (own, there))
        part = pairs / np.maximum(all_pairs, 1)
        step = np.abs(within - around * part) / np.maximum(1 - part, 0.1)
        span = whole - near_by + 1
        most = np.maximum(most, cv2.dilate(step, np.ones((span, 1) if axis else (1, span), np.uint8)))
    ending = cv2.dilate((~known).astype(np.uint8), np.ones((2 * reach + 1,) * 2, np.uint8)) > 0
    return np.where(ending, np.inf, most).astype(np.float32)


def _totals(values: Array, size: int, axis: int) -> Array:
    """[H, W] sums over `size` neighbours in a row (axis 0) or a column, no more than there are."""
    window = (1, size) if axis else (size, 1)
    return cv2.boxFilter(values, -1, window, normalize=False, borderType=cv2.BORDER_CONSTANT)


def _linked(known: Array, target: Array, demanded: tuple[Array, Array]) -> list[tuple[Array, Array, Array]]:
    """Neighbours [P] with a surface, in rows and in columns: their numbers, and the step wanted beyond the target's."""
    index = np.cumsum(known.ravel()).reshape(known.shape) - 1
    pairs = []
    for near, far, asked in between(demanded):
        both = known[near] & known[far]
        pairs.append((index[near][both], index[far][both], (asked - (target[far] - target[near]))[both]))
    return pairs


def _pairs(known: Array, target: Array, demanded: tuple[Array, Array], change: Array) -> Pairs:
    """Linked neighbours [P]: their unknowns, the step wanted on top of the target's own, and its weight."""
    parts = []
    linked = _linked(known, target, demanded)
    for (near, far, _), (first, second, wanted) in zip(between(demanded), linked, strict=True):
        around = np.minimum(change[near], change[far])[known[near] & known[far]]
        least = np.where(np.isinf(around), BREAK, np.maximum(BREAK, PART * around))
        parts.append((first, second, wanted, (around > sum(STEP) / 2) & (np.abs(wanted) > least)))
    first, second, wanted, broken = (np.concatenate(column) for column in zip(*parts, strict=True))
    broken = _without_spots(first, second, wanted, broken, int(known.sum()))
    return first, second, wanted, np.where(broken, OPEN, 1.0)


def _without_spots(first: Array, second: Array, step: Array, broken: Array, count: int) -> Array:
    """[P] bool: the broken pairs, less those around a small patch that is nearer, or farther, than all around it.

    What lies between two surfaces, as the blur of an edge does, is no such patch.

    Args:
        first, second: [P] pixels, of `count`. step: [P] from the one to the other. broken: [P] bool, bound the patches.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    for _ in range(ROUNDS):
        held = ~broken
        graph = coo_matrix((np.ones(int(held.sum()), np.int8), (first[held], second[held])), (count, count))
        label = connected_components(graph, directed=False)[1]
        a, b = label[first], label[second]
        across = broken & (a != b)
        patch, sign = np.concatenate([a[across], b[across]]), np.sign(np.concatenate([step[across], -step[across]]))
        patches = int(label.max()) + 1
        edges = np.bincount(patch, minlength=patches)
        spot = (np.bincount(label, minlength=patches) < LEAST_PATCH) & (edges > 0)
        spot &= np.abs(np.bincount(patch, sign, patches)) > ONE_SIDED * edges
        if not spot.any():
            break
        broken = broken & ~(spot[a] | spot[b])
    return broken
