"""Textures that do not repeat: mirrored or clamped ones as ones that do, with coordinates to match.

Surfaces repeat their maps; a mirrored map is stored with its mirror image beside it, a clamped one with its border
continued as far as the coordinates reach.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from materialist.types import Array, Surface

MAPS = ("albedo", "roughness", "metallic")
TOLERANCE = 1e-3
"""How far coordinates may leave [0, 1] unnoticed: rounding of exporters."""


def wrapped(
    surface: Surface, uv: Array, faces: Array, wrap: tuple[str, str], pixels: int
) -> tuple[Surface, Array, bool]:
    """(surface, uv [V, 2], whether the texture lies exactly) for a surface that repeats; uv [V, 2] v DOWN.

    wrap: `repeat`, `mirror` or `clamp` along u and v. pixels: how many a map may have when it is continued.
    """
    exact = True
    uv = np.array(uv, np.float64)
    for axis, mode in enumerate(wrap):
        if mode == "mirror":
            surface = _mirrored(surface, 1 - axis)
            uv[:, axis] /= 2
        elif mode == "clamp":
            surface, uv[:, axis], fits = _clamped(surface, uv[:, axis], faces, 1 - axis, pixels)
            exact = exact and fits
    return surface, uv, exact


def _mirrored(surface: Surface, axis: int) -> Surface:
    def both(values: Array) -> Array:
        return np.concatenate([values, np.flip(values, axis)], axis)

    return _each_map(surface, axis, both)


def _clamped(
    surface: Surface, u: Array, faces: Array, axis: int, pixels: int
) -> tuple[Surface, Array, bool]:
    """(surface with its maps continued along an axis, u [V] on them, whether they reach far enough)."""
    maps = [getattr(surface, name) for name in MAPS]
    sizes = [values.shape[axis] for values in maps if values.shape[axis] > 1]
    if not sizes or (u.min() >= -TOLERANCE and u.max() <= 1 + TOLERANCE):
        return surface, u, True
    step = 1 / math.gcd(*sizes)  # whole pixels of every map
    corner = u[faces]
    crossing = ~((corner <= 0).all(1) | (corner >= 1).all(1))
    # Faces wholly outside show the border alone, however far they reach.
    inner = u[np.unique(faces[crossing])]
    before = math.ceil(max(-inner.min(initial=0), 0) / step) + 1
    after = math.ceil(max(inner.max(initial=1) - 1, 0) / step) + 1
    # --- As far as the limit of pixels allows ---
    largest = max(values.shape[0] * values.shape[1] for values in maps)
    room = max(int((pixels / largest - 1) / step), 2)
    exact = before + after <= room
    if not exact:
        before = min(before, room // 2)
        after = min(after, room // 2)
    low = before * step
    high = after * step

    def continued(values: Array) -> Array:
        size = values.shape[axis]
        index = np.arange(-round(low * size), size + round(high * size))
        return np.take(values, np.clip(index, 0, size - 1), axis)

    inside = np.clip(u, -low + step / 2, 1 + high - step / 2)
    return _each_map(surface, axis, continued), (inside + low) / (1 + low + high), exact


def _each_map(surface: Surface, axis: int, change: Callable[[Array], Array]) -> Surface:
    """The surface with its maps changed; those of one value along the axis stay."""
    maps = {name: getattr(surface, name) for name in MAPS}
    changed: dict[str, Any] = {
        name: change(values) for name, values in maps.items() if values.shape[axis] > 1
    }
    return replace(surface, **changed)
