"""How far walls go on beyond the picture, as the light on what the picture shows tells.

A continued wall shuts out the light from beside and above, and its shadow's edge may lie in the picture. Which extents
are right nobody sees; but with wrong ones no light explains the photo as well.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch

from materialist.fit.engine import TransportEngine
from materialist.fit.light import envmap_field, fit_light, start_radiance
from materialist.fit.losses import residual
from materialist.fit.settings import FitSettings
from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.completion import ContinuedWall, complete, continued_walls
from materialist.geometry.extents import PlaneExtent
from materialist.geometry.planes import find_planes
from materialist.types import Array, Camera, Geometry, Materials, Prediction

SIDES = ("left", "right", "up")
NO_PLANES = np.full((1, 1), -1, np.int8)
"""Labels of a geometry whose materials are asked for by pixel alone."""


@dataclass(frozen=True)
class FoundExtents:
    """What a search came to."""

    ends: tuple[PlaneExtent, ...]
    error: float
    """Mean absolute error (encoded) that a light leaves under the prior's materials."""
    usual: float
    """The same with the usual extents."""


def find_extents(
    photo: Array, prior: Prediction, camera: Camera, settings: FitSettings, *, tau: float = 6.0, seed: int = 0
) -> FoundExtents | None:
    """The extents of the walls of a photo [H, W, 3] linear; None if there are none, or the usual ones do as well.

    One side of one wall after the other moves to where a light fitted to a small version of the photo leaves the least
    error.
    """
    chosen, searched = settings.extents, replace(settings.light, schedule=settings.extents.schedule)
    photo, prior, camera = reduced(photo, prior, camera, chosen.side)
    planes = find_planes(prior.depth, prior.normal, camera, seed=seed)
    walls = continued_walls(planes, prior.depth, camera)
    mesh = depth_to_mesh(prior.depth, prior.normal, camera, tau=tau)

    @cache
    def error(ends: tuple[PlaneExtent, ...]) -> float:
        geometry = Geometry(complete(mesh, planes, prior.depth, camera, extents=ends), NO_PLANES)
        engine = TransportEngine(
            geometry, camera, photo, seed=seed, light_height=settings.light_grid, light_pixels=chosen.pixels
        )
        problem = engine.light_problem(prior.materials)
        flat = torch.from_numpy(photo.reshape(-1, 3))
        light = envmap_field(searched, seed=seed, start=start_radiance(flat, searched))
        fit_light(problem, flat, light, searched, seed=seed)
        with torch.no_grad():
            found = problem.render(light(problem.height))
            return float(residual(found, flat[problem.pixels], "srgb", clipped=True).abs().mean())

    def better(best: tuple[PlaneExtent, ...], others: list[tuple[PlaneExtent, ...]]) -> tuple[PlaneExtent, ...]:
        """The best of the others where that is clearly better: a little is gained by any wall."""
        least = min(others, key=error)
        return least if error(least) < (1 - chosen.gain) * error(best) else best

    if not walls:
        return None
    usual = tuple(wall.usual for wall in walls)
    even = [tuple(at_level(wall, level) for wall in walls) for level in chosen.levels[:-1]]
    ends = better(usual, [tuple(map(nowhere, walls)), *even])
    for k, wall in enumerate(walls):
        for side in SIDES:
            moved = [moved_to(ends[k], wall, side, level) for level in chosen.levels]
            ends = better(ends, [(*ends[:k], end, *ends[k + 1 :]) for end in moved])
    return None if ends == usual else FoundExtents(ends, error(ends), error(usual))


def at_level(wall: ContinuedWall, level: float) -> PlaneExtent:
    """The usual lower side, and the others at a level beyond what is seen of the wall, in its seen size."""
    seen, beyond = wall.seen, level * wall.size
    return replace(
        wall.usual, left=seen.left - beyond, right=seen.right + beyond, down=min(wall.usual.down, seen.down),
        up=seen.up + beyond,
    )  # fmt: skip


def moved_to(end: PlaneExtent, wall: ContinuedWall, side: str, level: float) -> PlaneExtent:
    """The extent with one side at a level; a wall that went nowhere has the others where the picture shows them."""
    if end.right <= end.left:
        end = at_level(wall, 0)
    return replace(end, **{side: getattr(at_level(wall, level), side)})


def nowhere(wall: ContinuedWall) -> PlaneExtent:
    """No continuation."""
    return replace(wall.usual, right=wall.usual.left, up=wall.usual.down)


def reduced(photo: Array, prior: Prediction, camera: Camera, side: int) -> tuple[Array, Prediction, Camera]:
    """Every n-th pixel of a photo [H, W, 3] and its prior, so that the longer side has about `side`."""
    step = max(1, round(max(camera.width, camera.height) / side))
    pick = np.s_[step // 2 :: step, step // 2 :: step]
    part = lambda values: np.ascontiguousarray(values[pick])  # noqa: E731
    depth = part(prior.depth)
    if not (depth > 0).any():
        return photo, prior, camera
    maps = Materials(*(part(getattr(prior.materials, name)) for name in ("albedo", "roughness", "metallic")))
    small = replace(prior, materials=maps, normal=part(prior.normal), depth=depth)
    return part(photo), small, Camera(depth.shape[1], depth.shape[0], camera.fov)
