"""What ClickNet sees of a photo: its colours, normals and depth, and how they differ from those at the clicks."""

from collections.abc import Sequence

import numpy as np

from materialist.types import Array

CHANNELS = 14
NORMAL_X = 3
"""First channel of the normals."""
SPOT = 12
"""The channel that is high at the clicks."""
NEAR = 3.0
"""Pixels within which a click is told sharply."""
DEEP = 2.0
"""Largest difference of logarithms of depth that is told from larger ones."""


def features(rgb: Array, normal: Array, depth: Array, clicks: Sequence[tuple[int, int]]) -> Array:
    """The maps [CHANNELS, H, W] float32 that ClickNet reads of rgb [H, W, 3] sRGB in [0, 1], normal [H, W, 3] unit,
    depth [H, W] planar in any unit, 0 = no surface, and clicks (column, row) on one object, at least one.

    rgb - 0.5; normal; log depth over that of the clicks; surface; |rgb - clicks'| (3); cosine to the clicks' normals; a
    spot at the clicks; the distance to them, in units of the longer side. Of several clicks, the one that a pixel is
    most like counts.
    """
    height, width = depth.shape
    surface = depth > 0
    log = np.log(np.where(surface, depth, 1.0))
    rows, columns = np.indices(depth.shape)
    level, colour = np.full(depth.shape, np.inf), np.full(rgb.shape, np.inf)
    cosine, away = np.full(depth.shape, -1.0), np.full(depth.shape, np.inf)
    for x, y in clicks:
        near = np.s_[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2]
        here = np.median(log[near][surface[near]]) if surface[near].any() else 0.0
        other = np.clip(log - here, -DEEP, DEEP)
        level = np.where(np.abs(other) < np.abs(level), other, level)
        off = np.abs(rgb - np.median(rgb[near].reshape(-1, 3), 0))
        colour = np.where((off.sum(-1) < colour.sum(-1))[..., None], off, colour)
        facing = normal[near].reshape(-1, 3).mean(0)
        cosine = np.maximum(cosine, normal @ (facing / max(float(np.linalg.norm(facing)), 1e-6)))
        away = np.minimum(away, np.hypot(rows - y, columns - x))
    spot = np.exp(-((away / NEAR) ** 2) / 2)
    parts = [
        rgb - 0.5, normal, np.where(surface, level, DEEP)[..., None], surface[..., None], colour, cosine[..., None],
        spot[..., None], (away / max(height, width))[..., None],
    ]  # fmt: skip
    return np.ascontiguousarray(np.moveaxis(np.concatenate(parts, -1), -1, 0), np.float32)
