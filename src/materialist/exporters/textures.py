"""The maps as 8-bit pictures."""

from __future__ import annotations

import io

import numpy as np

from materialist.color import linear_to_srgb
from materialist.io.display import to_bytes
from materialist.types import Array, Materials


def base_color(materials: Materials) -> Array:
    """[H, W, 3] uint8: the albedo, sRGB-encoded."""
    return to_bytes(linear_to_srgb(materials.albedo))


def metallic_roughness(materials: Materials) -> Array:
    """[H, W, 3] uint8, not encoded, as glTF packs it: red 0 (unused), green roughness, blue metallic."""
    return to_bytes(np.stack([np.zeros_like(materials.roughness), materials.roughness, materials.metallic], -1))


def png(pixels: Array) -> bytes:
    """A PNG file of [H, W, 3] or [H, W] uint8."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", optimize=False)
    return buffer.getvalue()


def jpeg(pixels: Array, quality: int = 90) -> bytes:
    """A JPEG file of [H, W, 3] uint8 without chroma subsampling."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality, subsampling=0)
    return buffer.getvalue()
