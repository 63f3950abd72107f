"""Fireflies: single pixels that one path made far brighter than all around them, as glass focuses small lights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.color import luminance
from materialist.types import Array


@dataclass(frozen=True)
class FireflySettings:
    """Which pixels are fireflies."""

    bright: float = 1.0
    """Radiance up to which nothing is one: below white a sparkle does no harm (derived)."""
    times: float = 3.0
    """Largest multiple of the second brightest of the eight neighbours; larger keeps more (tuned by eye)."""
    wide: float = 10.0
    """Standard deviation, pixels, over which a firefly's light is spread where it must not be lost (tuned by eye)."""


DEFAULT = FireflySettings()


def without_fireflies(
    picture: Array, where: Array | None = None, *, spread: bool = False, settings: FireflySettings = DEFAULT
) -> Array:
    """[H, W, 3] linear with lone bright pixels brought down, their colour kept; a highlight of two pixels stays.

    Args:
        where: [H, W] bool: pixels that may change; all by default.
        spread: share the light of fireflies out to pixels of `where` around them instead of losing it. Lamps beside
            glass need it: no path through glass can aim at them, and lone paths bring all of their light.
    """
    from scipy.ndimage import rank_filter

    light = luminance(picture)
    around = np.ones((3, 3), bool)
    around[1, 1] = False
    second = rank_filter(light, -2, footprint=around, mode="nearest")
    limit = np.maximum(settings.times * second, settings.bright)
    where = np.ones(light.shape, bool) if where is None else where
    factor = np.where((light > limit) & where, limit / np.maximum(light, 1e-9), 1)
    found = (picture * factor[..., None]).astype(np.float32)
    return found + _spread(picture - found, where, settings.wide) if spread else found


def _spread(light: Array, where: Array, wide: float) -> Array:
    """[H, W, 3] the light of each pixel of `where`, shared out to those of `where` around it; its sum stays."""
    import cv2

    blurred = lambda v: cv2.GaussianBlur(v, (0, 0), wide, borderType=cv2.BORDER_CONSTANT)  # noqa: E731
    own = where.astype(np.float32)
    return blurred(np.float32(light) * (own / np.maximum(blurred(own), 1e-6))[..., None]) * own[..., None]
