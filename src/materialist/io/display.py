"""Maps as pictures for people: [H, W, 3] uint8."""

from __future__ import annotations

import numpy as np

from materialist.color import linear_to_srgb, luminance
from materialist.types import Array


def to_bytes(values: Array) -> Array:
    """[...] in [0, 1] to uint8; what lies outside is clipped, NaN becomes 0."""
    return np.round(np.clip(np.nan_to_num(values), 0, 1) * 255).astype(np.uint8)


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


def light(envmap: Array) -> Array:
    """An environment map [h, 2h, 3]: exposed so that its median is mid-grey, highlights rolled off (Reinhard)."""
    power = luminance(envmap)[..., None]
    key = max(float(np.median(power)), float(power.mean()) * 0.1, 1e-8)
    exposed = power * (0.22 / key)
    shown = exposed * (1 + exposed / 16) / (1 + exposed)
    return to_bytes(linear_to_srgb(envmap * (shown / np.maximum(power, 1e-8))))
