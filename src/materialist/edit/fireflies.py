"""Single pixels that one lucky path made far brighter than all around them: glass focuses small lights."""

from __future__ import annotations

import numpy as np

from materialist.color import luminance
from materialist.types import Array

BRIGHT = 1.0
"""Radiance up to which nothing is taken for a firefly: below white a sparkle does no harm."""
TIMES = 3.0
"""A pixel may be this many times as bright as the second brightest of its eight neighbours."""


def without_fireflies(picture: Array, where: Array | None = None) -> Array:
    """[H, W, 3] linear with lone bright pixels brought down, their colour kept; a highlight of two pixels stays.

    `where` [H, W] bool: pixels that may change; all by default. No pixel becomes brighter.
    """
    from scipy.ndimage import rank_filter

    light = luminance(picture)
    around = np.ones((3, 3), bool)
    around[1, 1] = False
    second = rank_filter(light, -2, footprint=around, mode="nearest")
    limit = np.maximum(TIMES * second, BRIGHT)
    lone = light > limit
    if where is not None:
        lone &= where
    factor = np.where(lone, limit / np.maximum(light, 1e-9), 1)
    return (picture * factor[..., None]).astype(np.float32)
