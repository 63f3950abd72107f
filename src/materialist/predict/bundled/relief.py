"""Depth joined with the normals: smooth along a surface, broken where it steps to another one.

Medians that put edges where the photo has them also print the photo's texture onto every slope, and a mesh with such
steps shades itself in single pixels.
"""

from __future__ import annotations

import numpy as np

from materialist.geometry.slopes import between, least_squares_change, slopes
from materialist.types import Array

STEP = 0.015
"""Change of log depth from pixel to pixel, beyond what the normals demand, above which two surfaces meet; by eye."""
OPEN = 1e-3
"""Weight of such a pair; larger joins the two surfaces."""
LENGTH = 10.0
"""Pixels above which the depth decides, below which the normals do; tuned by eye."""


def with_relief(sharp: Array, normal: Array, rays: Array) -> Array:
    """Logarithm of depth that follows the normals in the small, and `sharp` in the large and at its steps.

    Solves min over u of sum of w |u_q - u_p - g_pq|^2 over neighbours + sum |u_p - sharp_p|^2 / LENGTH^2, where g is
    the slope that the normals demand: n . d(z r) = 0 gives d log z = -n . dr / (n . r).

    Args:
        sharp: [H, W] logarithm of depth with edges, NaN where there is no surface.
        normal: [H, W, 3] unit. rays: [H, W, 2] x and y of the rays at z = -1.

    Returns:
        [H, W] float32, NaN where `sharp` is.
    """
    known = np.isfinite(sharp)
    if known.sum() < 9:
        return sharp
    index = np.cumsum(known.ravel()).reshape(known.shape) - 1
    pairs = []
    for near, far, asked in between(slopes(normal, rays)):
        both = known[near] & known[far]
        change = (sharp[far] - sharp[near])[both].astype(np.float64)
        slope = asked[both].astype(np.float64)
        weight = np.where(np.abs(change) > STEP + np.abs(slope), OPEN, 1.0)
        pairs.append((index[near][both], index[far][both], slope - change, weight))
    first, second, wanted, weight = (np.concatenate(column) for column in zip(*pairs, strict=True))
    pull = np.full(int(known.sum()), LENGTH**-2)
    found = np.array(sharp, np.float32)
    found[known] += least_squares_change(first, second, wanted, weight, pull, rtol=1e-3, maxiter=100)
    return found
