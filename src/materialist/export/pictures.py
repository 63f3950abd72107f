"""Maps as pictures for people: [H, W, 3] uint8."""

from __future__ import annotations

import numpy as np

from materialist.color import linear_to_srgb, luminance
from materialist.export.textures import to_bytes
from materialist.types import Array

ERROR_GAIN = 4
"""What errors are multiplied by to be seen."""


def grey(values: Array) -> Array:
    """A map [H, W] in [0, 1] as it is."""
    return np.repeat(to_bytes(values)[..., None], 3, -1)


def ramp(values: Array) -> Array:
    """A map [H, W] in [0, 1] by a perceptually even ramp from black to pale yellow."""
    import cv2

    return cv2.applyColorMap(to_bytes(values), cv2.COLORMAP_INFERNO)[..., ::-1]


def normals(normal: Array) -> Array:
    """Usual colours of camera-frame normals [H, W, 3]; black where there is none."""
    return np.where(np.any(normal != 0, -1, keepdims=True), to_bytes(normal * 0.5 + 0.5), 0).astype(np.uint8)


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


def light(envmap: Array) -> Array:
    """An environment map [h, 2h, 3]: exposed so that its median is mid-grey, highlights rolled off."""
    power = luminance(envmap)[..., None]
    key = max(float(np.median(power)), float(power.mean()) * 0.1, 1e-8)
    exposed = power * (0.22 / key)
    shown = exposed * (1 + exposed / 16) / (1 + exposed)
    return to_bytes(linear_to_srgb(envmap * (shown / np.maximum(power, 1e-8))))
