"""A whole scene before it is rendered: parts with materials, light from afar, openings, and a camera."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from materialist.procedural.materials import Material
from materialist.procedural.objects.shapes import Solid
from materialist.types import Array


@dataclass(frozen=True)
class ScenePart:
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
class Viewpoint:
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

    parts: list[ScenePart]
    envmap: Array
    """[h, 2h, 3] float32 linear radiance in the scene frame, in the project's envmap convention."""
    view: Viewpoint
    portals: list[Portal] = field(default_factory=list)
    kind: str = ""


def look(position: Array, target: Array, fov: float, roll: float = 0.0) -> Viewpoint:
    """The camera at `position` [3] that looks at `target` [3], rolled by `roll` radians."""
    back = np.asarray(position, float) - target
    back /= np.linalg.norm(back)
    right = np.cross([0, 1, 0], back)
    right /= max(np.linalg.norm(right), 1e-9)
    up = np.cross(back, right)
    c, s = np.cos(roll), np.sin(roll)
    return Viewpoint(np.asarray(position, float), np.stack([c * right + s * up, c * up - s * right, back], -1), fov)


def look_down(
    target: Array, distance: float, turn: float, up: float, fov: float, roll: float = 0.0, within: Array | None = None
) -> Viewpoint:
    """The camera that looks at `target` [3] from `distance` metres, `turn` radians to its side and `up` above it.

    within: [2, 3] lower and upper corner of a box that the camera stays in.
    """
    eye = target + distance * np.array([np.sin(turn) * np.cos(up), np.sin(up), np.cos(turn) * np.cos(up)])
    return look(eye if within is None else np.clip(eye, *within), target, fov, roll)
