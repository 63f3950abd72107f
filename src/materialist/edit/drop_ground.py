"""The ground that things fall onto: what the photo shows and its continued planes, along gravity."""

from __future__ import annotations

from typing import Any

import numpy as np

from materialist.camera import unproject
from materialist.edit.convex import hull
from materialist.edit.ground import blocks, field
from materialist.edit.physics import Thing
from materialist.types import Array, Scene

REACH = 6.0
"""Half of the side of the ground that things can fall onto, in longest sides."""
FLAT = 0.004
"""How plane a block of the ground must be, in longest sides."""


def ground_below(scene: Scene, things: list[Thing], to_up: Array, factor: float, metres: float) -> list[Array]:
    """Convex blocks [8, 3] each (metres, z up) under and around things; `to_up` [3, 3] and `factor` lead there."""
    from materialist.render.scene import RenderScene

    target = RenderScene(scene.geometry, scene.camera, bodies=scene.bodies)
    starts = np.stack([thing.centre for thing in things])
    top = float(max((thing.centre + p)[:, 2].max() for thing in things for p in thing.pieces)) + metres
    visible = unproject(scene.depth, scene.camera)[scene.depth > 0].astype(np.float64) @ to_up.T * factor
    half = REACH * metres + float(np.ptp(starts[:, :2], axis=0).max()) / 2
    ground = field(
        lambda x, y, top: _heights(target, to_up, factor, x, y, top), visible, starts[:, :2].mean(0), half, top, metres
    )  # fmt: skip
    found = blocks(ground, flat=FLAT * metres, depth=2 * metres)
    return [hull(block) for block in found]


def _heights(target: Any, to_up: Array, factor: float, x: Array, y: Array, top: float) -> Array:
    """z [n] (metres) of what rays downwards from `top` meet first in a `RenderScene`, NaN for nothing."""
    from materialist.render.buffers import floats

    mi = target.mi
    start = np.stack([x, y, np.full_like(x, top)], -1) / factor @ to_up  # back in the camera frame
    origin = mi.Point3f(*(floats(mi, start[:, k]) for k in range(3)))
    direction = mi.Vector3f(*(float(v) for v in -to_up[2]))
    hit = target.mi_scene.ray_intersect_preliminary(mi.Ray3f(origin, direction))
    distance = np.array(hit.t, np.float64) * factor
    return np.where(np.isfinite(distance) & np.array(hit.is_valid()), top - distance, np.nan)
