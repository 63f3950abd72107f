"""Depth joined with the normals: smooth where the network saw one surface, broken where it saw two.

Medians that put edges where the photo has them also print the photo's texture onto every slope, and a mesh with such
steps shades itself in single pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.geometry.slopes import Pairs, between, least_squares_change, slopes
from materialist.types import Array


@dataclass(frozen=True)
class ReliefSettings:
    """When two neighbours lie on two surfaces, and how far the normals decide. Tuned by eye."""

    step: tuple[float, float] = (0.02, 0.05)  # change of log depth within reach, beyond the slopes': none, and an edge
    broken: float = 0.008  # change of log depth from pixel to pixel, beyond the slope's, that may stay at an edge
    part: float = 0.12  # part of the change within reach in one such pair: an edge is one step, texture is many
    open: float = 1e-3  # weight of such a pair; larger joins the two surfaces
    blurred: float = 0.4  # part of the reach over which the network blurs an edge
    length: float = 10.0  # pixels above which the depth decides, below which the normals do


SETTINGS = ReliefSettings()


def with_relief(coarse: Array, sharp: Array, normal: Array, rays: Array, *, reach: int) -> Array:
    """Logarithm of depth that follows the normals in the small, `sharp` at edges, `coarse` elsewhere.

    Solves min over u of sum of w |u_q - u_p - g_pq|^2 over neighbours + sum |u_p - target_p|^2 / length^2, where g is
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
    edge = np.clip((change - SETTINGS.step[0]) / (SETTINGS.step[1] - SETTINGS.step[0]), 0, 1) ** 2
    target = np.where(known, edge * np.nan_to_num(sharp) + (1 - edge) * np.nan_to_num(coarse), 0).astype(np.float64)
    pairs = _pairs(known, target, demanded, change)
    moved = least_squares_change(*pairs, np.full(int(known.sum()), SETTINGS.length**-2), rtol=1e-3, maxiter=100)
    found = np.full(coarse.shape, np.nan, np.float32)
    found[known] = target[known] + moved
    return found


def excess(coarse: Array, known: Array, demanded: tuple[Array, Array], reach: int) -> Array:
    """[H, W] step of log depth within reach of a pixel, along a row or a column, that the normals do not explain.

    A step is what changes more over a part of the reach than over all of it: a floor whose predicted normal is a
    little off changes everywhere alike, and has no edge. Infinite next to where the surface ends, whose outline stays
    as it is.
    """
    most = np.zeros(coarse.shape, np.float32)
    near_by, whole = 2 * max(1, round(SETTINGS.blurred * reach)) + 1, 2 * reach + 1
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


def _pairs(known: Array, target: Array, demanded: tuple[Array, Array], change: Array) -> Pairs:
    """Neighbours [P] in rows and columns: their unknowns, the step wanted beyond the target's own, and its weight."""
    index = np.cumsum(known.ravel()).reshape(known.shape) - 1
    pairs = []
    for near, far, asked in between(demanded):
        both = known[near] & known[far]
        wanted = (asked - (target[far] - target[near]))[both]
        around = np.minimum(change[near], change[far])[both]
        least = np.where(np.isinf(around), SETTINGS.broken, np.maximum(SETTINGS.broken, SETTINGS.part * around))
        broken = (around > sum(SETTINGS.step) / 2) & (np.abs(wanted) > least)
        pairs.append((index[near][both], index[far][both], wanted, np.where(broken, SETTINGS.open, 1.0)))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*pairs, strict=True))
    return first, second, wanted, weight
