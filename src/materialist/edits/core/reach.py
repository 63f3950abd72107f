"""How much of what the photo shows a sun would reach."""

from typing import Any

import numpy as np

from materialist.camera import pixel_rays
from materialist.envmap import direction_of
from materialist.geometry.planes import level_frame
from materialist.types import Array, Scene

POINTS = 4096
"""Pixels, evenly spread, of which a ray is traced to the sun."""
LIFT = 1e-3
"""Start of a ray before its surface, share of the depth (derived: grid of the mesh)."""
ELEVATIONS = (20, 45, 70)
AZIMUTHS = tuple(range(-150, 181, 30))
"""Directions, degrees, among which a better sun is looked for."""
MUCH = 0.7
"""Share of what the best of them lights from which one is good enough."""


def sun_reach(scene: Scene, azimuth: float, elevation: float) -> tuple[float, float]:
    """(share of the photo's surfaces that face a sun, share that it lights); directions as of `relight`."""
    level = level_frame(scene.normal, scene.geometry.plane_label)
    return _reach(_setup(scene), level @ direction_of(azimuth, elevation))


def better_sun(scene: Scene, azimuth: float, elevation: float) -> tuple[tuple[float, float], float]:
    """(azimuth and elevation in degrees, share) of the nearest sun that lights much of what the photo shows."""
    traced = _setup(scene)
    places = [(float(az), float(el)) for az in AZIMUTHS for el in ELEVATIONS]
    directions = np.array([direction_of(*place) for place in places])
    level = level_frame(scene.normal, scene.geometry.plane_label)
    shares = np.array([_reach(traced, level @ direction)[1] for direction in directions])
    cosine = directions @ direction_of(azimuth, elevation)
    cosine[shares < MUCH * shares.max()] = -np.inf
    best = int(np.argmax(cosine))
    return places[best], float(shares[best])


def _setup(scene: Scene) -> tuple[Any, Array, Array]:
    """(the mesh as a Mitsuba scene, points [N, 3] a little before it, their normals [N, 3])."""
    from materialist.render.variant import setup

    setup()
    from materialist.transport.cache import build_scene

    rows, columns = np.nonzero(scene.depth > 0)
    step = max(1, len(rows) // POINTS)
    rows = rows[::step]
    columns = columns[::step]
    depth = scene.depth[rows, columns] * (1 - LIFT)
    points = pixel_rays(scene.camera)[rows, columns] * depth[:, None]
    return build_scene(scene.geometry.mesh), points, scene.normal[rows, columns]


def _reach(traced: tuple[Any, Array, Array], towards: Array) -> tuple[float, float]:
    """(share that faces a direction [3], share from which it is seen)."""
    import mitsuba as mi

    mesh, points, normals = traced
    if not len(points):
        return 0.0, 0.0
    facing = normals @ towards > 0
    origin = mi.Point3f(*(np.ascontiguousarray(v, np.float32) for v in points.T))
    direction = mi.Vector3f(*(float(v) for v in towards))
    hidden = np.array(mesh.ray_test(mi.Ray3f(origin, direction)))
    return float(facing.mean()), float((facing & ~hidden).mean())
