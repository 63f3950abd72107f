"""Surfaces of bodies, and the names of bodies that stand for something in the photo."""

from __future__ import annotations

from typing import Any

import numpy as np

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
