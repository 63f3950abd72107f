"""What things fall onto: the scene as a height field along gravity, cut into convex blocks.

Coordinates are those of the simulation: metres, z up. `to_up` [3, 3] and `factor` lead there from the camera frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from materialist.camera import unproject
from materialist.types import Array, Scene

CELLS = 128
"""Cells along each side of the field."""
STEEP = 0.15
"""Height over the floor, as a share of the thing's size, from which upright surfaces count."""
BLOCKS = 1500
"""Most blocks; the flatness that a block must have is relaxed until there are no more."""
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


@dataclass(frozen=True)
class Field:
    """Heights over a square of ground, z up."""

    corner: Array
    """[2] x and y of the first grid point."""
    cell: float
    """Distance of grid points."""
    height: Array
    """[n + 1, n + 1] z of the surface at (x, y) = corner + cell * (column, row); NaN where there is none."""


def field(shoot, points: Array, centre: Array, half: float, top, size: float) -> Field:
    """The surface below z = `top` in a square around `centre` [2].

    Args:
        shoot: shoot(x [n], y [n], z [n]) -> z [n] of what a ray downwards meets first, NaN for nothing.
        points: [m, 3] points of the visible surface. Rays along gravity miss what is upright; where such points stand
            out of the field by more than STEEP * size, they raise it.
        half: half of the square's side. top: top(x [n], y [n]) -> z [n]. size: longest side of the falling thing.
    """
    steps = np.linspace(-half, half, CELLS + 1)
    x, y = np.meshgrid(centre[0] + steps, centre[1] + steps)
    height = shoot(x.ravel(), y.ravel(), top(x.ravel(), y.ravel())).reshape(x.shape)
    cell = 2 * half / CELLS
    low = np.nanmin(height) if np.isfinite(height).any() else 0.0
    column = np.round((points[:, 0] - x[0, 0]) / cell).astype(int)
    row = np.round((points[:, 1] - y[0, 0]) / cell).astype(int)
    inside = (column >= 0) & (column <= CELLS) & (row >= 0) & (row <= CELLS)
    inside &= points[:, 2] < top(points[:, 0], points[:, 1])
    column, row, z = column[inside], row[inside], points[inside, 2]
    upright = z > np.nan_to_num(height[row, column], nan=low - size) + STEEP * size
    np.fmax.at(height, (row[upright], column[upright]), z[upright])
    return Field(np.array([x[0, 0], y[0, 0]]), cell, height)


def blocks(ground: Field, *, flat: float, depth: float) -> list[Array]:
    """Corners [8, 3] of convex blocks whose tops are the field, to within `flat`, and which reach `depth` below it.

    Large where the ground is plane: a square is halved in both directions until its grid points lie on a plane.
    """
    for relaxed in range(8):
        found: list[Array] = []
        _split(ground, 0, 0, ground.height.shape[0] - 1, flat * 2**relaxed, depth, found)
        if len(found) <= BLOCKS:
            break
    return found


def _split(ground: Field, row: int, column: int, n: int, flat: float, depth: float, found: list[Array]) -> None:
    part = ground.height[row : row + n + 1, column : column + n + 1]
    known = np.isfinite(part)
    if not known.any() or (n == 1 and known.sum() < 4):
        return
    if n == 1:
        found.append(_block(ground, row, column, 1, part[[0, 0, 1, 1], [0, 1, 0, 1]], depth))
        return
    if known.all():
        y, x = np.mgrid[: n + 1, : n + 1]
        system = np.stack([np.ones(x.size), x.ravel(), y.ravel()], -1)
        plane = np.linalg.lstsq(system, part.ravel(), rcond=None)[0]
        if np.abs(system @ plane - part.ravel()).max() <= flat:
            tops = np.array([[1, 0, 0], [1, n, 0], [1, 0, n], [1, n, n]]) @ plane
            found.append(_block(ground, row, column, n, tops, depth))
            return
    half = n // 2
    for r in (row, row + half):
        for c in (column, column + half):
            _split(ground, r, c, half, flat, depth, found)


def _block(ground: Field, row: int, column: int, n: int, tops: Array, depth: float) -> Array:
    """[8, 3]: four corners with their heights, and four far below."""
    x = ground.corner[0] + ground.cell * (column + n * np.array([0, 1, 0, 1]))
    y = ground.corner[1] + ground.cell * (row + n * np.array([0, 0, 1, 1]))
    return np.concatenate([np.stack([x, y, tops], -1), np.stack([x, y, np.full(4, tops.min() - depth)], -1)])


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

        A ray down that meets a back face first begins in a solid: it meets that at its start.
        """
        from materialist.buffers import floats

        mi, sign = self.target.mi, 1.0 if upwards else -1.0
        start = np.stack([x, y, z], -1) / self.factor @ self.to_up  # back in the camera frame
        origin = mi.Point3f(*(floats(mi, start[:, k]) for k in range(3)))
        direction = mi.Vector3f(*(float(sign * v) for v in self.to_up[2]))
        hit = self.target.mi_scene.ray_intersect(mi.Ray3f(origin, direction))
        met = np.array(hit.is_valid())
        distance = np.where(met, np.array(hit.t, np.float64) * self.factor, np.nan)
        if not upwards:
            distance[met & (np.array(hit.n, np.float64).T @ self.to_up[2] < -BEHIND)] = 0
        return z + sign * distance

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

    def start(self, points: Array, lift: float, least: float, metres: float) -> tuple[Array, float] | None:
        """Where a thing that stands with its points [n, 3] is let go of: its shift [3], and z that sees its ground.

        That is `lift` over its place, or lower, but not below `least`, where something hangs there. None where both are
        inside of something.
        """
        high = float(points[:, 2].max())
        under = min(lift, max(self.room_over(points, metres) - GAP * metres, 0.0))
        for raised, space in ((lift, metres), (under, GAP * metres / 2)):
            top = high + raised + space
            deep = depth_in(self.ground([middle(points)], [top], metres), points + np.array([0, 0, raised]))
            if raised >= least and deep <= BUMP * metres:
                return np.array([0, 0, raised + max(deep, 0.0)]), top
        return None


def middle(points: Array) -> Array:
    """[2] x and y of the middle of the box around points [n, 3]."""
    return (points.min(0) + points.max(0))[:2] / 2


def blocks_of(ground: Field, metres: float) -> list[Array]:
    """Convex blocks [8, 3] each, for things whose longest side is `metres`."""
    return blocks(ground, flat=FLAT * metres, depth=2 * metres)


def depth_in(ground: Field, points: Array) -> float:
    """How deep points [n, 3] lie in the ground at most; < 0 over it. A cell counts as high as its highest corner."""
    column, row = np.floor((points[:, :2] - ground.corner) / ground.cell).astype(int).T
    z = ground.height
    cells = np.stack([z[:-1, :-1], z[:-1, 1:], z[1:, :-1], z[1:, 1:]]).max(0)  # NaN beside a hole
    inside = (column >= 0) & (row >= 0) & (column < cells.shape[1]) & (row < cells.shape[0])
    deep = cells[row[inside], column[inside]] - points[inside, 2]
    return float(np.nanmax(deep)) if np.isfinite(deep).any() else -np.inf
