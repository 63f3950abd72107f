"""Pictures of mesh files as arrays."""

import io
import math
from collections import Counter
from collections.abc import Hashable
from typing import Any

import numpy as np
from PIL import Image

from materialist.edits.insert.formats.source import MeshSource
from materialist.io.bitmap import pixel_limit_lifted
from materialist.types import Array, Surface

GREY = 0.5
"""Albedo and roughness where a file says nothing."""
KINDS = ("PNG", "JPEG", "WEBP", "AVIF", "BMP", "TGA", "TIFF", "GIF", "PPM", "DDS")
"""Pillow's readers that a texture may wake; some of the others start programs."""


class Textures:
    """The pictures of a file: first the sizes of all, then their pixels one by one."""

    def __init__(self, source: MeshSource):
        self.source = source
        self.damaged = 0
        """How many cannot be read."""
        self._encoded: dict[Hashable, bytes | None] = {}
        self._sizes: dict[Hashable, tuple[int, int]] = {}
        self._uses: Counter[Hashable] = Counter()

    def add(self, key: Hashable, data: bytes) -> None:
        """Look at the header of a picture, once for each use of it.

        Raises InputError beyond the limits of pictures and pixels.
        """
        self._uses[key] += 1
        if key in self._encoded:
            return
        self._encoded[key] = None
        self.source.check("pictures", len(self._encoded))
        try:
            with pixel_limit_lifted():
                image = Image.open(io.BytesIO(data), formats=KINDS)
        except (OSError, ValueError, SyntaxError):
            self.damaged += 1
            return
        self.source.check("picture_pixels", math.prod(image.size))
        self._encoded[key] = data
        self._sizes[key] = image.size
        self.source.check("all_picture_pixels", sum(map(math.prod, self._sizes.values())))

    def pixels(self, key: Hashable, mode: str = "RGB") -> Array | None:
        """[h, w, 3] as stored: uint8, or float32 in [0, 1] of deeper greys; None for none, or a damaged one.

        mode: `RGB`, or `RGBA` for [h, w, 4] uint8. Pictures are shrunk where their longer side exceeds `side`.
        """
        data = self._encoded.get(key)
        if data is None:
            return None
        try:
            with pixel_limit_lifted():
                return self._decoded(Image.open(io.BytesIO(data), formats=KINDS), mode)
        except (OSError, ValueError, SyntaxError, EOFError):
            self.damaged += 1
            self._encoded[key] = None
            return None

    @property
    def side(self) -> int:
        """Longest side that is kept, pixels: the limit, halved until the maps made of all keep theirs."""
        limits = self.source.limits
        side = self.source.limits.texture
        images = [(size, self._uses[key]) for key, size in self._sizes.items()]
        while (
            side > 16 and sum(n * _kept(size, side) for size, n in images) > limits.texture_pixels
        ):
            side //= 2
        return side

    def notes(self) -> list[str]:
        """Sentences on what could not be kept as it is in the file."""
        notes = []
        if self.damaged:
            notes.append("a texture cannot be read; a constant takes its place.")
        side = self.side
        if side < self.source.limits.texture and any(
            max(size) > side for size in self._sizes.values()
        ):
            notes.append(
                f"its textures are shrunk to {side} pixels, because they are large together."
            )
        return notes

    def _decoded(self, image: Any, mode: str) -> Array:
        side = self.side
        # Greys of 16 bits or floats: Pillow's "RGB" would clip them at 255.
        if mode == "RGB" and image.mode.startswith(("I", "F")):
            values = np.asarray(image, np.float32) / np.float32(1 if image.mode == "F" else 65535)
            image = _shrunk(Image.fromarray(values), side)
            return np.repeat(np.asarray(image, np.float32)[..., None], 3, -1)
        return np.asarray(_shrunk(image, side).convert(mode))


def _kept(size: tuple[int, int], side: int) -> float:
    """Pixels that are left of a picture (width, height)."""
    return math.prod(size) * min(1.0, side / max(size)) ** 2


def _shrunk(image: Any, side: int) -> Any:
    if max(image.size) <= side:
        return image
    if image.mode in ("P", "PA", "1"):
        image = image.convert("RGBA")
    if len(image.getbands()) == 1 or image.mode in ("RGB", "YCbCr", "CMYK"):
        image.thumbnail((side, side))  # in place: the large one is let go
        return image
    bands = []
    for name in image.getbands():  # Pillow would multiply a copy of all of it by alpha
        bands.append(image.getchannel(name))
        bands[-1].thumbnail((side, side))
    return Image.merge(image.mode, bands)


def unit_range(pixels: Array, factor: float = 1.0) -> Array:
    """float32 of pixels as stored, times a factor."""
    values = pixels.astype(np.float32)
    values *= np.float32(factor / 255 if pixels.dtype == np.uint8 else factor)
    return values


def clipped_surface(albedo: Array, roughness: Array, metallic: Array) -> Surface:
    """A surface of maps [h, w, 3], [h, w], [h, w] that may leave [0, 1]; float32 ones are changed in place."""
    return Surface(_clipped(albedo), _clipped(roughness), _clipped(metallic))


def _clipped(values: Array) -> Array:
    values = np.ascontiguousarray(values, np.float32)
    np.fmax(values, 0, out=values)  # NaN becomes 0
    return np.fmin(values, 1, out=values)
