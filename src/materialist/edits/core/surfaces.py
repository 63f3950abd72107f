"""Surfaces of bodies, and the names of bodies that stand for something in the photo."""

from __future__ import annotations

from typing import Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.types import Array, Surface

PHOTO_LIGHT = "photo light"
"""Names of bodies that are emitters of the photo begin so."""
PHOTO_GLASS = "photo glass"
"""Names of bodies that are objects of the photo turned to glass begin so."""


def uniform_surface(albedo: Array | float, roughness: float, metallic: float, **fields: Any) -> Surface:
    """A surface without texture; albedo [3] linear, or one number for a grey. `fields` are others of `Surface`."""
    colour = np.broadcast_to(np.asarray(albedo, np.float32), (3,)).reshape(1, 1, 3).copy()
    flat = lambda v: np.full((1, 1), v, np.float32)  # noqa: E731
    return Surface(colour, flat(roughness), flat(metallic), **fields)


def triple(values: Array) -> tuple[float, float, float]:
    """Three numbers as a tuple of plain floats, as files and comparisons want them."""
    a, b, c = (float(v) for v in values)
    return a, b, c


def parse_colour(colour: tuple[float, float, float] | str, name: str = "albedo") -> Array:
    """[3] float32 linear colour from (R, G, B) linear, "R,G,B" linear, or "#rrggbb" sRGB.

    Raises InputError with the given `name`.
    """
    if isinstance(colour, str) and colour.startswith("#"):
        try:
            if len(colour) != 7:
                raise ValueError
            return srgb_to_linear(np.array([int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)], np.float32))
        except ValueError as error:
            raise InputError(f"The {name} {colour!r} must look like #ff8800.") from error
    try:
        parts = colour.split(",") if isinstance(colour, str) else colour
        rgb = np.array([float(c) for c in parts], np.float32)
    except (TypeError, ValueError) as error:
        raise InputError(f"The {name} {colour!r} must be R,G,B with three numbers in [0, 1], or #rrggbb.") from error
    if rgb.shape != (3,) or not (np.isfinite(rgb).all() and (rgb >= 0).all() and (rgb <= 1).all()):
        raise InputError(f"The {name} {colour!r} must be R,G,B with three numbers in [0, 1], or #rrggbb.")
    return rgb
