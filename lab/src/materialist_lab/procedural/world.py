"""A whole scene before it is rendered: parts with materials, light from afar, openings, and a camera."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from materialist.camera import turn_upright
from materialist.types import Array
from materialist_lab.procedural.materials import Material
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.objects.shapes import Solid


@dataclass(frozen=True)
class ScenePart:
    """One surface of one material."""

    solid: Solid
    material: Material
    thing: object | None = None
    """What the part belongs to: parts of one thing have the same; None for walls, floors and the like."""


Parts = list[ScenePart]


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
    aperture: float = 0.0
    """Diameter of the lens, metres; 0: everything is sharp."""
    focus: float = 1.0
    """Distance that is sharp, metres."""


@dataclass(frozen=True)
class World:
    """Everything that is needed to render one sample."""

    parts: list[ScenePart]
    envmap: Array
    """[h, 2h, 3] float32 linear radiance in the scene frame, in the project's envmap convention."""
    view: Viewpoint
    portals: list[Portal] = field(default_factory=list)
    kind: str = ""
    backdrop: Array | None = None
    """[h, w, 3] linear radiance that the camera sees where there is no surface, at any size; None for the envmap."""


def look(position: Array, target: Array, fov: float, roll: float = 0.0) -> Viewpoint:
    """The camera at `position` [3] that looks at `target` [3], rolled by `roll` radians."""
    # A camera looks along its -Z.
    back = np.asarray(position, float) - target
    upright = turn_upright(back / np.linalg.norm(back))
    # About the axis of the view.
    c = np.cos(roll)
    s = np.sin(roll)
    rolled = upright @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return Viewpoint(np.asarray(position, float), rolled, fov)


def orbit(
    target: Array, distance: float, azimuth: float, elevation: float, fov: float
) -> Viewpoint:
    """The camera that looks at `target` [3] from `distance` metres, at an azimuth (from +Z towards +X) and elevation in
    radians."""
    x = np.cos(elevation) * np.sin(azimuth)
    y = np.sin(elevation)
    z = np.cos(elevation) * np.cos(azimuth)
    back = np.array([x, y, z])
    return Viewpoint(target + distance * back, turn_upright(back), float(fov))


def through_lens(
    rng: np.random.Generator, view: Viewpoint, focus: float, share: float
) -> Viewpoint:
    """The view, with that probability through a lens that blurs what is not about `focus` metres away.

    Its aperture blurs what is far by 1 to 6 % of the picture's width, whatever the scale of the scene.
    """
    if rng.random() > share:
        return view
    reach = 2 * np.tan(np.radians(view.fov) / 2)  # widths of the picture a metre, at one metre
    blur = np.exp(rng.uniform(np.log(0.01), np.log(0.06)))
    # A point at infinity is blurred over aperture / focus metres at one metre.
    aperture = float(blur * reach * focus)
    return replace(view, aperture=aperture, focus=float(focus * rng.uniform(0.9, 1.1)))


def block(
    size: ArrayLike,
    at: ArrayLike,
    material: Material,
    radius: float = 0.0,
    *,
    turn: float = 0.0,
    tip: float = 0.0,
) -> ScenePart:
    """A slab of `size` [3] standing at `at` [3], its edges rounded by `radius`; tipped about X, turned about Y."""
    return ScenePart(shapes.moved(shapes.slab(size, radius), at, turn, tip), material)


def rod(points: ArrayLike, radius: ArrayLike, material: Material, n: int = 8) -> ScenePart:
    """A round rod along points [P, 3]."""
    return ScenePart(shapes.tube(points, radius, n), material)


def orb(at: ArrayLike, radius: float, material: Material, n: int = 24) -> ScenePart:
    """A ball about `at` [3]."""
    return ScenePart(shapes.moved(shapes.ball(n), at, scale=radius), material)


def one_thing(parts: Parts) -> Parts:
    """The parts, those that belong to nothing yet as one thing."""
    # Any new object is a name of its own.
    thing = object()
    return [part if part.thing is not None else replace(part, thing=thing) for part in parts]


def moved(parts: Parts, at: ArrayLike, turn: float = 0.0) -> Parts:
    """The parts turned about Y and moved by `at` [3]."""
    return [replace(p, solid=shapes.moved(p.solid, at, turn)) for p in parts]


def placed(parts: Parts, at: ArrayLike, turn: float = 0.0) -> Parts:
    """The parts turned about Y and moved by `at` [3], as one thing but for those that are things already."""
    return moved(one_thing(parts), at, turn)


def bounds(parts: Parts) -> tuple[Array, Array]:
    """[3] lower and [3] upper corner of the box around the parts, metres."""
    points = np.concatenate([p.solid.vertices for p in parts])
    return points.min(0), points.max(0)
