"""Extents of planes: where the continuation of a wall or ceiling ends beyond the picture."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.camera import unit
from materialist.errors import InputError
from materialist.geometry.planes import Plane
from materialist.types import Array

_SAME_NORMAL, _SAME_OFFSET = np.cos(np.radians(15.0)), 0.15
"""A plane found anew on changed maps is the same one within this angle (cosine) and relative distance; tuned by eye."""
_NUMBERS = ("offset", "left", "right", "down", "up")


@dataclass(frozen=True)
class PlaneExtent:
    """A rectangle on one plane, in the plane's own `axes`, whose origin is the point nearest to the camera."""

    normal: tuple[float, float, float]
    """Unit, camera frame, facing the camera."""
    offset: float
    """Scene units, < 0, as `Plane.offset`."""
    left: float
    right: float
    down: float
    up: float
    """Coordinates of its sides, scene units; left < right, down < up, as seen by one who faces the wall."""

    def corners(self) -> Array:
        """[4, 2] counter-clockwise."""
        return np.array([[self.left, self.down], [self.right, self.down], [self.right, self.up], [self.left, self.up]])


def read_extents(provenance: dict[str, Any]) -> tuple[PlaneExtent, ...]:
    """The extents of continued walls in a scene's provenance; none in that of an older version.

    Raises:
        InputError: they cannot be read.
    """
    try:
        return tuple(
            PlaneExtent((float(n[0]), float(n[1]), float(n[2])), *(float(one[name]) for name in _NUMBERS))
            for one in provenance.get("ends") or ()
            for n in (one["normal"],)
        )
    except (TypeError, KeyError, IndexError, ValueError) as error:
        raise InputError(
            f"The scene's provenance says {provenance['ends']!r} about the ends of its walls, which cannot be read; "
            'take "ends" out of its scene.json.'
        ) from error


def axes(normal: Array) -> Array:
    """[2, 3] unit: to the right and up for one who faces a plane with this normal [3]; of a ceiling, any such pair."""
    normal = np.asarray(normal, np.float64)
    across = unit(np.cross([0.0, 1, 0] if abs(normal[1]) < 0.9 else [0.0, 0, 1], normal))
    return np.stack([across, np.cross(normal, across)])


def extent_of(plane: Plane, extents: Iterable[PlaneExtent]) -> PlaneExtent | None:
    """The extent that belongs to this plane, if any."""
    close = [
        (float(np.dot(e.normal, plane.normal)), e)
        for e in extents
        if np.dot(e.normal, plane.normal) > _SAME_NORMAL
        and abs(e.offset - plane.offset) <= _SAME_OFFSET * max(-e.offset, -plane.offset)
    ]
    return max(close, key=lambda pair: pair[0])[1] if close else None
