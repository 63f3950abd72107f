"""Whether an object is a surface of revolution: its axis by its normals, else by its outline.

Normals of a surface of revolution all meet its axis; exact ones say where it stands to a tenth of a degree, and every
visible point tells a place of the profile. Predicted normals are rarely that clean: then the outline tells both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays, unit
from materialist.geometry.silhouette import object_size, surface_in, window
from materialist.solids.outline import by_outline
from materialist.solids.revolution import Axis, Revolution, profile_of
from materialist.types import Array, Camera


@dataclass(frozen=True)
class FinderSettings:
    """When normals are taken to be those of one surface of revolution."""

    fewest: int = 64  # pixels below which an object is too small to tell
    coarse: int = 40  # pixels along the object while its axis is looked for
    round: float = 0.035  # largest mean sine between normals and the planes through the axis; tuned by eye
    off: float = 1.5  # largest root mean square distance of the front from the profile, cells
    through: float = 0.03  # largest share of the front just below which rays pass freely
    behind: tuple[float, ...] = (0.1, 0.3, 0.5)  # first guesses of the axis' place, object sizes behind the front
    reach: float = 1.5  # farthest place of the axis, in object sizes: normals of one plane all meet at infinity
    tilts: tuple[float, ...] = (0.05, 0.25, 0.45)  # first guesses of how far the camera looks down, radians
    usual: float = 0.28  # the angle at which things that stand somewhere are usually seen, radians
    level: float = 0.02  # cost of the square of a deviation from it: for balls any tilt will do


DEFAULT = FinderSettings()


def surface_of_revolution(
    depth: Array, normal: Array, mask: Array, camera: Camera, *, up: Array | None = None, behind: Array | None = None
) -> tuple[Revolution, Array] | None:
    """An object that is a surface of revolution and its thickness [H, W] float32 along the rays, scene units; or None.

    depth: [H, W] planar, scene units, 0 = none. normal: [H, W, 3] unit. mask: [H, W] bool or weights: one object.
    up: [3] unit, the axis' direction in the camera's frame, where a support tells it; else the camera is taken
        not to lean sideways, and the angle at which it looks down is found with the axis.
    behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the object ends above it.
    Raises InputError for maps of different sizes, or a mask without any surface.
    """
    inside = surface_in(mask, depth, camera)
    if inside.sum() < DEFAULT.fewest:
        return None
    rays = pixel_rays(camera).astype(np.float64)
    depth, normal = np.asarray(depth, np.float64), np.asarray(normal, np.float64)
    found = _by_normals(depth, normal, inside, rays, up, behind)
    if found is not None:
        return found, found.thickness(depth, inside, rays)
    found = by_outline(depth, normal, inside, camera, up=up, behind=behind)
    if found is None:
        return None
    front, _ = found.front(inside, rays)
    return found, found.thickness(np.where(front > 0, front, depth), inside, rays)


def upright(normal: Array, plane: Array) -> Array | None:
    """[3] unit, camera frame: the mean normal of the largest plane that faces upwards, or None.

    normal [H, W, 3] unit, plane [H, W] int: the plane of a pixel, -1 for none.
    """
    counts = np.bincount(plane[plane >= 0], minlength=1)
    for k in np.argsort(-counts)[: np.count_nonzero(counts > 12)]:
        mean = unit(normal[plane == k].mean(0, dtype=np.float64))
        if mean[1] > 0.6:
            return mean
    return None


def _by_normals(
    depth: Array, normal: Array, inside: Array, rays: Array, up: Array | None, behind: Array | None
) -> Revolution | None:
    axis, sine = _axis(depth, normal, inside, rays, up)
    if sine > DEFAULT.round:
        return None
    profile = profile_of(depth, normal, inside, rays, axis, behind)
    fits = profile.off <= DEFAULT.off and profile.through <= DEFAULT.through
    return Revolution(axis, profile) if fits and profile.lines() else None


def _axis(depth: Array, normal: Array, inside: Array, rays: Array, up: Array | None) -> tuple[Axis, float]:
    """The axis that the normals meet best, and their mean sine with the planes through it."""
    from scipy.optimize import minimize

    rows, columns = window(inside)
    step = max(1, round((max(rows.stop - rows.start, columns.stop - columns.start) - 1) / DEFAULT.coarse))
    thin = np.zeros_like(inside)
    thin[rows.start :: step, columns.start :: step] = True
    thin &= inside
    points, normals = (rays * depth[..., None])[thin], normal[thin]  # [N, 3]
    size = object_size(inside, depth, rays)
    centre = np.array([*points[:, :2].mean(0), np.median(points[:, 2])])

    def axis(values: Array) -> Axis:
        """Of its place to the right of and behind the middle of the front, object sizes, and the tilt, radians."""
        upward = np.array([0, np.cos(values[2]), np.sin(values[2])]) if up is None else up
        foot = centre + size * np.array([values[0], 0, -values[1]])
        return Axis(upward, foot + (np.percentile(points @ upward, 1) - foot @ upward) * upward)

    def sine(values: Array) -> float:
        tried = axis(values)
        return float(np.abs((normals * unit(np.cross(tried.up, points - tried.foot))).sum(-1)).mean())

    def cost(values: Array) -> float:
        far = np.maximum(np.abs(values[:2]) - DEFAULT.reach, 0).sum()
        return sine(values) + far + (DEFAULT.level * (values[2] - DEFAULT.usual) ** 2 if up is None else 0)

    starts = [np.array([0.0, b, t]) for b in DEFAULT.behind for t in (DEFAULT.tilts if up is None else (0.0,))]
    found = []
    for start in sorted(starts, key=cost)[:3]:
        first = np.stack([start, *(start + np.diag([0.08, 0.12, 0.12]))])
        options = {"maxfev": 200, "xatol": 1e-3, "fatol": 1e-6, "initial_simplex": first}
        found.append(minimize(cost, start, method="Nelder-Mead", options=options))
    best = min(found, key=lambda one: one.fun).x
    return axis(best), sine(best)
