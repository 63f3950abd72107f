"""The ground that things fall onto, what hangs over them, and what stands in their way, along gravity.

Coordinates are those of the simulation: metres, z up. `to_up` [3, 3] and `factor` lead there from the camera frame.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.camera import unproject
from materialist.edits.drop.ground import Field, blocks, field, tops
from materialist.types import Array, Scene

REACH = 6.0
"""Half of the side of the ground that things can fall onto, in longest sides."""
FLAT = 0.004
"""How plane a block of the ground must be, in longest sides."""
GAP = 0.05
"""Room that is left under what hangs over a thing, in longest sides."""
BUMP = 0.2
"""Height of what a thing is lifted over where it would start in it, in longest sides; the rest stands in its way."""
BEHIND = 0.05
"""Least cosine of a face's normal with a ray for the ray to come from behind."""
LOW = 0.25
"""Height up to which what rises above a flat thing is ground, in longest sides."""
RINGS = 8
"""Distances, up to one longest side, at which a free place is looked for, in as many directions times two."""


@dataclass(frozen=True)
class Surroundings:
    """A scene that rays along gravity look at."""

    target: Any
    """`RenderScene` of its geometry and bodies."""
    visible: Array
    """[n, 3] points of the visible surface."""
    to_up: Array
    factor: float
    """Metres a scene unit."""

    @classmethod
    def of(cls, scene: Scene, to_up: Array, factor: float) -> Surroundings:
        """Those of a scene, with the bodies it has."""
        from materialist.render.scene import RenderScene

        target = RenderScene(scene.geometry, scene.camera, bodies=scene.bodies)
        visible = unproject(scene.depth, scene.camera)[scene.depth > 0].astype(np.float64) @ to_up.T * factor
        return cls(target, visible, to_up, factor)

    def meets(self, x: Array, y: Array, z: Array, upwards: bool = False) -> Array:
        """z [n] of what rays down (or up) from (x, y, z) [n] meet first, NaN for nothing.

        A ray down that begins in a solid, which rays up and down meet from behind, meets it at its start.
        """
        start = np.stack([x, y, z], -1) / self.factor @ self.to_up  # back in the camera frame
        distance, behind = self._trace(start, 1.0 if upwards else -1.0)
        if not upwards and behind.any():  # or it comes on the back of an open surface
            distance[behind & self._trace(start, 1.0)[1]] = 0
        return z + (distance if upwards else -distance)

    def _trace(self, start: Array, sign: float) -> tuple[Array, Array]:
        """(metres to what rays up (1) or down (-1) from [n, 3] meet first, NaN for nothing; whether from behind)."""
        from materialist.buffers import floats

        mi = self.target.mi
        origin = mi.Point3f(*(floats(mi, start[:, k]) for k in range(3)))
        direction = mi.Vector3f(*(float(sign * v) for v in self.to_up[2]))
        hit = self.target.mi_scene.ray_intersect(mi.Ray3f(origin, direction))
        met = np.array(hit.is_valid())
        distance = np.where(met, np.array(hit.t, np.float64) * self.factor, np.nan)
        return distance, met & (np.array(hit.n, np.float64).T @ (sign * self.to_up[2]) > BEHIND)

    def room_over(self, points: Array, metres: float) -> float:
        """How far a thing that stands with its points [n, 3] can be lifted before it meets what hangs over it.

        inf under nothing. What does not rise above the thing as it stands, or above LOW, is ground or beside it.
        """
        low, high = points.min(0), points.max(0)
        steps = np.linspace(0, 1, 9)
        x, y = (v.ravel() for v in np.meshgrid(*(low[k] + steps * (high[k] - low[k]) for k in (0, 1))))
        z = np.full_like(x, max(high[2], low[2] + LOW * metres))
        over = self.meets(x, y, z, upwards=True)
        return float(np.nanmin(over) - high[2]) if np.isfinite(over).any() else np.inf

    def ground(self, places: list[Array], tops: list[float], metres: float) -> Field:
        """Heights under and around places [2], seen from `tops` (z) over each and over what lies nearest to it."""
        middles = np.stack(places)
        half = REACH * metres + float(np.ptp(middles, axis=0).max()) / 2

        def top(x: Array, y: Array) -> Array:
            nearest = ((np.stack([x, y], -1)[:, None] - middles) ** 2).sum(-1).argmin(1)
            return np.asarray(tops)[nearest]

        return field(self.meets, self.visible, middles.mean(0), half, top, metres)

    def start(
        self, points: Array, lift: float, least: float, metres: float, taken: Sequence[tuple[Array, Array]] = ()
    ) -> tuple[Array, float] | None:
        """Where a thing that stands with its points [n, 3] is let go of: its shift [3], and z that sees its ground.

        That is `lift` over its place; lower, but not below `least`, where something hangs there; or beside the place,
        where something stands there. None where all of that would be inside of something, or of the boxes (low, high)
        that are `taken`.
        """
        low, high = points.min(0), points.max(0)
        under = min(lift, max(self.room_over(points, metres) - GAP * metres, 0.0))
        heights = [(lift, metres)]
        if least <= under < lift:
            heights.append((under, GAP * metres / 2))
        looks = []
        for raised, space in heights:
            top = float(high[2]) + raised + space
            ground = self.ground([middle(points)], [top], metres)
            looks.append((raised, top, ground, tops(ground, blocks_of(ground, metres))))
        for ways in (np.zeros((1, 3)), _ways(metres)):
            for raised, top, ground, shape in looks:
                for way in ways:
                    shift = way + np.array([0, 0, raised])
                    deep = depth_in(ground, shape, points + shift)
                    shift[2] += max(deep, 0.0)
                    clear = not any(_meet(low + shift, high + shift, *box) for box in taken)
                    if deep <= BUMP * metres and clear:
                        return shift, top
        return None


def middle(points: Array) -> Array:
    """[2] x and y of the middle of the box around points [n, 3]."""
    return (points.min(0) + points.max(0))[:2] / 2


def blocks_of(ground: Field, metres: float) -> list[Array]:
    """Convex blocks [8, 3] each, for things whose longest side is `metres`."""
    return blocks(ground, flat=FLAT * metres, depth=2 * metres)


def _meet(low: Array, high: Array, other_low: Array, other_high: Array) -> bool:
    """Whether two boxes have room in common."""
    return bool((low < other_high).all() and (high > other_low).all())


def _ways(metres: float) -> Array:
    """[n, 3] shifts to the side, the shortest first."""
    turn = np.arange(2 * RINGS) * np.pi / RINGS
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(2 * RINGS)], -1)
    return np.concatenate([metres * ring / RINGS * circle for ring in range(1, RINGS + 1)])


def depth_in(ground: Field, tops: Array, points: Array) -> float:
    """How deep points [n, 3] lie in the blocks of the ground at most; < 0 over them.

    tops: [n, n, 4], see `ground.tops`; a block counts as high as its highest corner. Points that stand for a surface
    would miss the tip of a block between them.
    """
    column, row = np.floor((points[:, :2] - ground.corner) / ground.cell).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < tops.shape[1]) & (row < tops.shape[0])
    deep = tops[row[inside], column[inside]].max(-1) - points[inside, 2]
    deep = deep[np.isfinite(deep)]
    return float(deep.max()) if len(deep) else -np.inf
