"""Directions towards the light that reaches the scene: where the map is bright and nothing hides it from all of it."""

from __future__ import annotations

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.bsdf.lobes import face_towards, lifted
from materialist.buffers import floats
from materialist.camera import pixel_rays
from materialist.envmap import row_solid_angle
from materialist.types import Array, Camera

ROWS = 32
"""Rows of cells in which openness is measured."""
FINEST = 128
"""Most rows of cells that directions are chosen from."""
POINTS, RAYS = 2048, 128
"""Places in the picture whose surfaces look around, and how many rays each sends."""
ANYWHERE = 0.05
"""Least openness that is believed: what few rays found may still arrive."""
WORTH = 0.15
"""Share of the light that must stand out for aiming at it to be worth its rays."""


def openness(scene: Any, camera: Camera, *, seed: int = 0) -> Array:
    """[ROWS, 2 ROWS] how much of each cell's light arrives at what the camera sees, cosines included; 1 in the mean."""
    rng = np.random.default_rng(seed)
    size = camera.width * camera.height
    chosen = ((np.arange(POINTS) + rng.random(POINTS)) * size / POINTS).astype(np.int64)
    seen = mi.Vector3f(*(floats(mi, np.repeat(c, RAYS)) for c in pixel_rays(camera).reshape(-1, 3)[chosen].T))
    si = scene.ray_intersect(mi.Ray3f(mi.Point3f(0), dr.normalize(seen)))
    u, v = (floats(mi, x) for x in rng.random((2, POINTS * RAYS)))
    side = dr.select(si.wi.z > 0, mi.Float(1), mi.Float(-1))
    local = mi.warp.square_to_cosine_hemisphere(mi.Point2f(u, v)) * mi.Vector3f(1, 1, side)
    direction = si.to_world(lifted(local, face_towards(si.to_local(si.n), mi.Vector3f(0, 0, side))))
    free = si.is_valid() & ~scene.ray_test(si.spawn_ray(direction), si.is_valid())
    index = np.array(_cell(direction, ROWS))[np.array(free)]
    share = np.bincount(index, minlength=2 * ROWS * ROWS).reshape(ROWS, 2 * ROWS) / row_solid_angle(ROWS)[:, None]
    return share / max(share.mean(), 1e-12)


class LightSampler:
    """A distribution of directions, constant in each cell of a map's grid.

    Light that is not brighter than usual has none: scattered directions find it better, and the weights by which both
    are brought together let them (MIS compensation, Karlik et al. 2019).

    Args:
        envmap: [h, 2h, 3] linear radiance. openness: see `openness`.
    """

    def __init__(self, envmap: Array, openness: Array):
        luma = _looked_up(envmap.astype(np.float64).mean(-1))
        step = 1
        while len(luma) // step > FINEST and len(luma) % (2 * step) == 0:
            step *= 2
        self.rows = rows = len(luma) // step
        luma = luma.reshape(rows, step, 2 * rows, step).mean((1, 3))
        at = (ROWS * (np.arange(2 * rows) + 0.5) / rows).astype(np.int64)  # of columns; rows are the first half
        angle = row_solid_angle(rows)[:, None]
        reach = np.maximum(openness, ANYWHERE)[at[:rows]][:, at] * angle
        arriving = float((luma * reach).sum())
        more = np.maximum(luma - arriving / reach.sum(), 0) * reach
        self.share = float(more.sum()) / max(arriving, 1e-30)
        """Share of the light that stands out."""
        weight = more / more.sum() if more.sum() > 0 else reach / reach.sum()
        self._cells = mi.DiscreteDistribution2D(weight.astype(np.float32))
        self._density = floats(mi, (weight / angle).ravel())

    @property
    def worth(self) -> bool:
        """Whether rays are well spent on these directions."""
        return self.share > WORTH

    def sample(self, point):
        """Unit direction (Vector3f) for a point of the unit square, and its density per solid angle.

        Heights are chosen by one coordinate and azimuths by the other: points that are spread over the square are
        spread over a lamp. Taken row by row in one go, a lamp of four rows got every fourth of them at one azimuth.
        """
        at, _, within = self._cells.sample(mi.Point2f(point.y, point.x))
        row, col = mi.Float(at.y), mi.Float(at.x)
        top, bottom = dr.cos(dr.pi * row / self.rows), dr.cos(dr.pi * (row + 1) / self.rows)
        y = top + (bottom - top) * within.y
        s, c = dr.sincos(((col + within.x) / (2 * self.rows) - 0.5) * dr.two_pi)
        r = dr.safe_sqrt(1 - y * y)
        return mi.Vector3f(r * s, y, -r * c), dr.gather(mi.Float, self._density, at.y * (2 * self.rows) + at.x)

    def pdf(self, direction, active: Any = True):
        """Density of unit directions, per solid angle."""
        return dr.gather(mi.Float, self._density, _cell(direction, self.rows), active)


def _looked_up(luma: Array) -> Array:
    """[h, w] means over each texel of what bilinear lookups find there."""
    around = np.pad(luma, ((1, 1), (0, 0)), mode="edge")
    luma = (around[:-2] + 6 * luma + around[2:]) / 8
    return (np.roll(luma, 1, 1) + 6 * luma + np.roll(luma, -1, 1)) / 8


def _cell(direction, rows: int):
    """Index of the cell that a unit direction lies in, row-major in a map of `rows` rows."""
    u = dr.atan2(direction.x, -direction.z) * dr.inv_two_pi + 0.5
    v = dr.safe_acos(direction.y) * dr.inv_pi
    column = mi.UInt32(dr.clip(u * (2 * rows), 0, 2 * rows - 1))
    return mi.UInt32(dr.clip(v * rows, 0, rows - 1)) * (2 * rows) + column
