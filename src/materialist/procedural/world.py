"""A whole scene before it is rendered: parts with materials, light from afar, openings, and a camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from materialist.procedural.materials import Material
from materialist.procedural.objects.shapes import Solid
from materialist.types import Array


@dataclass(frozen=True)
class Part:
    """One surface of one material."""

    solid: Solid
    material: Material
    thing: object | None = None
    """What the part belongs to: parts of one thing have the same; None for walls, floors and the like."""


@dataclass(frozen=True)
class Portal:
    """A rectangle through which light from afar enters: where a light ray is worth aiming at."""

    corner: Array
    """[3] metres, scene frame (+Y up)."""
    right: Array
    """[3] one side, metres."""
    up: Array
    """[3] the other side, metres; right x up points into the scene."""


@dataclass(frozen=True)
class View:
    """A camera in the scene frame."""

    position: Array
    """[3] metres."""
    to_scene: Array
    """[3, 3] rotation that turns camera directions into scene directions."""
    fov: float
    """Horizontal field of view, degrees."""


@dataclass(frozen=True)
class World:
    """Everything that is needed to render one sample."""

    parts: list[Part]
    envmap: Array
    """[h, 2h, 3] float32 linear radiance in the scene frame, in the project's envmap convention."""
    view: View
    portals: list[Portal] = field(default_factory=list)
    kind: str = ""


def look(position: Array, target: Array, fov: float, roll: float = 0.0) -> View:
    """The camera at `position` [3] that looks at `target` [3], rolled by `roll` radians."""
    back = np.asarray(position, float) - target
    back /= np.linalg.norm(back)
    right = np.cross([0, 1, 0], back)
    right /= max(np.linalg.norm(right), 1e-9)
    up = np.cross(back, right)
    c, s = np.cos(roll), np.sin(roll)
    return View(np.asarray(position, float), np.stack([c * right + s * up, c * up - s * right, back], -1), fov)
