"""sRGB and linear Rec.709. The only place where colour is encoded or decoded."""

import numpy as np

from materialist.records import Array

ROWS = 256
"""Rows of a picture encoded at a time: bounds the memory."""
CLIPPED = 0.99
"""Linear value from which a channel of an ordinary photo counts as clipped: the true radiance may be higher."""
LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)


def srgb_to_linear(srgb: Array) -> Array:
    """Decode sRGB (any shape) by the piecewise curve of IEC 61966-2-1; returns float32.

    srgb: values in [0, 1], or whole levels of a display file, uint8 or uint16.
    """
    srgb = np.asarray(srgb)
    if srgb.dtype.kind == "u":  # by table: as exact, and faster
        top = np.iinfo(srgb.dtype).max
        # A table of all levels.
        return srgb_to_linear(np.arange(top + 1, dtype=np.float32) / np.float32(top))[srgb]
    srgb = np.asarray(srgb, np.float32)
    return np.where(
        srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0) + 0.055) / 1.055) ** 2.4
    ).astype(np.float32)


def linear_to_srgb(linear: Array) -> Array:
    """Encode linear values (any shape, clipped to [0, 1]) as sRGB in [0, 1]; returns float32."""
    linear = np.clip(np.asarray(linear, np.float32), 0, 1)
    return np.where(
        linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055
    ).astype(np.float32)


def srgb_levels(linear: Array, dtype: type = np.uint8) -> Array:
    """Linear values [H, ...] (clipped to [0, 1]) as whole levels of a display file, uint8 or uint16; NaN is 0."""
    linear = np.asarray(linear, np.float32)
    top = float(np.iinfo(dtype).max)
    out: Array = np.empty(linear.shape, dtype)
    for start in range(0, len(linear), ROWS):
        # In float64: a level of 16 bits is near float32's precision at white.
        rows = slice(start, start + ROWS)
        out[rows] = np.round(np.nan_to_num(linear_to_srgb(linear[rows]).astype(np.float64)) * top)
    return out


def luminance(linear: Array) -> Array:
    """Rec.709 luminance [...] of linear RGB [..., 3]."""
    return np.asarray(linear, np.float32) @ LUMINANCE
