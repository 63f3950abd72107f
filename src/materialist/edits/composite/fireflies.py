"""Single pixels that one lucky path made far brighter than all around them: glass focuses small lights."""

from __future__ import annotations

import numpy as np

from materialist.color import luminance
from materialist.types import Array

BRIGHT = 1.0
"""Radiance up to which nothing is taken for a firefly: below white a sparkle does no harm."""
TIMES = 3.0
"""A pixel may be this many times as bright as the second brightest of its eight neighbours."""


WIDE = 10.0
"""Standard deviation, pixels, over which lone light is spread where it must not be lost."""


def without_fireflies(picture: Array, where: Array | None = None, *, spread: bool = False) -> Array:
    """[H, W, 3] linear with lone bright pixels brought down, their colour kept; a highlight of two pixels stays.

    `where` [H, W] bool: pixels that may change; all by default. No pixel becomes brighter, unless `spread`: what is
    taken away then lies about it, as wide as WIDE. So it is with lamps beside glass, through which no path
    can aim at them: what is seen there is lit by lone paths alone.
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
    found = (picture * factor[..., None]).astype(np.float32)
    return found + _spread(picture - found, np.ones(light.shape, bool) if where is None else where) if spread else found


def _spread(light: Array, where: Array) -> Array:
    """[H, W, 3] the light of each pixel of `where`, shared out to those of `where` around it; its sum stays."""
    import cv2

    blurred = lambda v: cv2.GaussianBlur(v, (0, 0), WIDE, borderType=cv2.BORDER_CONSTANT)  # noqa: E731
    own = where.astype(np.float32)
    return blurred(np.float32(light) * (own / np.maximum(blurred(own), 1e-6))[..., None]) * own[..., None]
