"""Low-discrepancy points of the transport cache and the path tracer."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.types import Array

TILE = 4
"""Neighbouring pixels in a TILE x TILE block draw interleaved parts of one point set, for the filter to join."""

# Generators of the R2 sequence (Roberts 2018): 1/g, 1/g^2 with g the plastic number.
R2 = (0.7548776662466927, 0.5698402909980532)


def pixel_shift(height: int, width: int, seed: int) -> Array:
    """[H, W, 2] float32 rotation of the point set per pixel: stratified over each tile, the same in all tiles."""
    rank = np.random.default_rng(seed).permutation(TILE * TILE).reshape(TILE, TILE)
    rows, cols = np.indices((height, width))
    order = rank[rows % TILE, cols % TILE].astype(np.float64)
    base = np.random.default_rng(seed + 1).random(2)
    return np.stack([(base[k] + order * R2[k]) % 1.0 for k in (0, 1)], -1).astype(np.float32)


def point(index, count, shift):
    """Point `index` of `count` in [0, 1)^2: a rank-1 lattice (Fibonacci) in the unit square, rotated by `shift`."""
    i = mi.Float(index)
    u = (i + 0.5) / mi.Float(count) + shift.x
    v = i * 0.6180339887498949 + shift.y
    return mi.Point2f(u - dr.floor(u), v - dr.floor(v))
