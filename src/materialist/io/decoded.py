"""A decoded photo, and the sizes that a photo may have."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from materialist.errors import InputError
from materialist.types import Array

OVER_WHITE = "Transparent parts are laid over white."
MAX_PIXELS = 200_000_000
"""Largest photo accepted, pixels: the largest phone sensors; 2.4 GB as float32."""
MIN_SIDE = 8
"""Shortest side accepted, pixels."""
MAX_ASPECT = 8
"""Longest shape accepted, long side over short side."""


@dataclass
class Decoded:
    """A decoded file."""

    linear: Array
    """[H, W, 3] float32 linear Rec.709, upright; display files in [0, 1], scene-linear ones (EXR, HDR) as stored."""
    scene_linear: bool = False
    """True for files that hold light rather than display values: EXR, HDR, float TIFF."""
    tags: dict[str, Any] = field(default_factory=dict)
    """EXIF by name."""
    warnings: list[str] = field(default_factory=list)
    over: bool = False
    """Whether transparent parts were laid over a radiance of the caller's: an EXR's."""


def check_size(width: int, height: int, name: object) -> None:
    """Refuse photos that are too small, too large or too long, before their pixels are decoded."""
    if width * height > MAX_PIXELS:
        raise InputError(
            f"{name} is {width} x {height} = {width * height / 1e6:.0f} megapixels; the limit is "
            f"{MAX_PIXELS / 1e6:.0f}: shrink it first."
        )
    if min(width, height) < MIN_SIDE:
        raise InputError(f"{name} is {width} x {height} pixels; at least {MIN_SIDE} on each side are needed.")
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise InputError(
            f"{name} is {width} x {height} pixels, longer than {MAX_ASPECT}:1; crop it to the part of interest."
        )
