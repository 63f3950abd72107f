"""How large the network sees a photo: as large as makes it no more crowded than the pictures that it learnt from.

A pixel of a crowded photo shows more than one of those pictures, and things of a few pixels are not seen; a bare wall,
seen too large, shows no border to any convolution. Miangoleh et al. 2021 ("Boosting Monocular Depth Estimation Models
to High-Resolution via Content-Adaptive Multi-Resolution Merging") choose the resolution by how far pixels are from the
nearest edge, and so does this.
"""

from __future__ import annotations

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.predict import resample
from materialist.types import Array

PLAIN = (192, 384)
"""Longest sides at which a photo no more crowded than that is seen: the whole, and details."""
LARGEST = 2.0
"""How much larger than that, at most, a crowded photo is seen."""
WHOLE = 0.75
"""Most of a photo's pixels along a side at which the whole is seen: two sizes know more than one."""
JUDGED = 256
"""Longest side at which the density is judged: that of the training pictures."""
EDGE = 0.1
"""Length of the gradient (sRGB-encoded, over three channels, a pixel) from which it is an edge: outlines, no grain."""
SPACING = 38.0
"""Pixels within which nine tenths of a crowded training picture have an edge: the median of 25 workshops. Of 40 others
one in ten has less, and half have 58 or more."""


def sides(linear: Array, longest: int) -> tuple[int, ...]:
    """Longest sides, in pixels, at which the network sees a photo [H, W, 3] linear in [0, 1], which is there with
    `longest` pixels at most."""
    most = float(np.clip(WHOLE * longest / PLAIN[0], 1, LARGEST))
    factor = float(np.clip(SPACING / max(spacing(linear), 1e-6), 1, most))
    return tuple(round(factor * side) for side in PLAIN)


def spacing(linear: Array) -> float:
    """Pixels within which nine tenths of the photo [H, W, 3] have an edge, when its longest side is JUDGED."""
    height, width = linear.shape[:2]
    factor = min(1.0, JUDGED / max(height, width))
    size = max(1, round(height * factor)), max(1, round(width * factor))
    seen = cv2.GaussianBlur(linear_to_srgb(resample.values(linear, size)), (0, 0), 1.0)
    across, down = (cv2.Sobel(seen, cv2.CV_32F, *which, scale=1 / 8) for which in ((1, 0), (0, 1)))
    edge = np.sqrt((across**2 + down**2).sum(-1)) > EDGE
    if not edge.any():
        return float(JUDGED)
    distance = cv2.distanceTransform((~edge).astype(np.uint8), cv2.DIST_L2, 5)
    return float(np.percentile(distance, 90)) * JUDGED / max(size)
