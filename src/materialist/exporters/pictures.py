"""Maps, errors and light as pictures for people: [H, W, 3] uint8."""

from __future__ import annotations

import numpy as np

from materialist.color import linear_to_srgb
from materialist.io.display import grey, light, normals, ramp
from materialist.types import Array

ERROR_GAIN = 4
"""What errors are multiplied by to be seen."""

__all__ = ["ERROR_GAIN", "error", "grey", "light", "nearness", "normals", "ramp"]


def nearness(depth: Array) -> Array:
    """Planar depth [H, W], near bright, far dark, by inverse depth; black where there is no surface."""
    seen = depth > 0
    if not seen.any():
        return np.zeros((*depth.shape, 3), np.uint8)
    inverse = np.where(seen, 1 / np.where(seen, depth, 1), 0)
    low, high = np.percentile(inverse[seen], (1, 99))
    return np.where(seen[..., None], ramp(0.08 + 0.92 * (inverse - low) / max(high - low, 1e-12)), 0).astype(np.uint8)


def error(photo: Array, rerender: Array) -> Array:
    """Mean absolute difference of two linear pictures [H, W, 3], sRGB-encoded, times ERROR_GAIN."""
    return ramp(ERROR_GAIN * np.abs(linear_to_srgb(photo) - linear_to_srgb(rerender)).mean(-1))
