"""How soft an object's outline is in the photo: out of focus, it colours pixels outside of its mask."""

from __future__ import annotations

import numpy as np

from materialist.color import linear_to_srgb
from materialist.types import Array

REACH = 0.02
"""How far from the object it may go, as a part of the picture's longer side."""
INSIDE = 0.006
"""How deep inside an object its own colour is, as such a part."""
APART = 0.15
"""Distance of object and surroundings (sRGB) from which a mixture of the two is told from either."""
LEAST = 0.04
"""Share of the object's colour, in the median along its outline, at which it has ended."""
FEWEST = 20
"""Pixels at one distance that tell."""


def softness(linear: Array, own: Array, apart: Array | None = None) -> int:
    """Pixels outside of an object [H, W] bool that have some of its colour, in the photo [H, W, 3] linear.

    Each is compared with the nearest pixels well inside and well outside; the median at each distance does not see
    neighbours and shadows, which lie on one side. `apart` [H, W] bool: what else does not count.
    """
    import cv2
    from scipy.ndimage import distance_transform_edt

    longest = max(own.shape)
    reach = max(2, round(REACH * longest))
    encoded = linear_to_srgb(linear)
    smooth = cv2.GaussianBlur(encoded, (0, 0), 1.0)
    away = distance_transform_edt(~own)
    sides = distance_transform_edt(own) > INSIDE * longest, away > reach + 2
    if not (sides[0].any() and sides[1].any()):
        return 0
    inner, outer = (
        smooth[tuple(distance_transform_edt(~side, return_distances=False, return_indices=True))] for side in sides
    )
    line = inner - outer
    length = (line**2).sum(-1)
    share = ((encoded - outer) * line).sum(-1) / np.maximum(length, 1e-6)
    for pixels in range(1, reach + 1):
        ring = (np.abs(away - pixels) <= 0.5) & (length > APART**2)
        if apart is not None:
            ring &= ~apart
        if ring.sum() < FEWEST or np.median(share[ring]) <= LEAST:
            return pixels - 1
    return reach
