"""Parts of things: blocks, rods and balls of one material, and groups of them moved as one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from materialist.procedural.materials import Material
from materialist.procedural.objects import solids as s
from materialist.procedural.world import ScenePart

Parts = list[ScenePart]


def block(
    size: ArrayLike, at: ArrayLike, material: Material, radius: float = 0.0, *, turn: float = 0.0, tip: float = 0.0
) -> ScenePart:
    """A slab of `size` [3] standing at `at` [3], its edges rounded by `radius`; tipped about X, turned about Y."""
    return ScenePart(s.moved(s.slab(size, radius), at, turn, tip), material)


def rod(points: ArrayLike, radius: ArrayLike, material: Material, n: int = 8) -> ScenePart:
    """A round rod along points [P, 3]."""
    return ScenePart(s.tube(points, radius, n), material)


def orb(at: ArrayLike, radius: float, material: Material, n: int = 24) -> ScenePart:
    """A ball about `at` [3]."""
    return ScenePart(s.moved(s.ball(n), at, scale=radius), material)


def one_thing(parts: Parts) -> Parts:
    """The parts, those that belong to nothing yet as one thing."""
    thing = object()
    return [part if part.thing is not None else replace(part, thing=thing) for part in parts]


def placed(parts: Parts, at: ArrayLike, turn: float = 0.0) -> Parts:
    """The parts turned about Y and moved by `at` [3], as one thing but for those that are things already."""
    return [replace(p, solid=s.moved(p.solid, at, turn)) for p in one_thing(parts)]


def standing(parts: Parts) -> Parts:
    """The parts moved up or down together, so that they stand on y = 0."""
    return placed(parts, (0, -min(float(p.solid.vertices[:, 1].min()) for p in parts), 0))


def footprint(parts: Parts) -> float:
    """Radius about the Y axis that holds all parts, metres."""
    return max(float(np.hypot(p.solid.vertices[:, 0], p.solid.vertices[:, 2]).max()) for p in parts)
