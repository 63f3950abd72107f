"""The surface under a pixel, as something to stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import rays_through, unit, unproject
from materialist.edits.core.region import checked_pixel
from materialist.errors import InputError
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SupportSettings:
    """Which pixels tell the plane that a thing stands on; tuned by eye."""

    alike: float = 0.7  # cosine from which a neighbour's normal counts as that of the same surface
    fewest: int = 12  # pixels whose median counts, at least; with fewer the one pixel decides
    nearby: float = 1 / 24  # radius around the place, share of the picture's width, where no radius is given


DEFAULT = SupportSettings()


@dataclass(frozen=True)
class Support:
    """A tangent plane."""

    point: Array
    """[3] float64: where the pixel's ray meets it, camera frame, scene units."""
    normal: Array
    """[3] float64 unit, to the camera."""
    depth: float
    """Planar depth of the point, scene units."""


def support_at(scene: Scene, at: tuple[float, float], radius: float | None = None) -> Support:
    """The plane through the surface around a point (x, y) of the working size.

    Its normal is the median of the scene's normals over the dominant plane that the point lies on, elsewhere over the
    pixels within `radius` (scene units) whose normals are alike: predicted depth bends planes more than predicted
    normals do. Its place along the normal is the median of the surface within the radius.

    Raises InputError for a point outside the photo, or on the sky.
    """
    column, row = checked_pixel(scene, at, "place")
    depth = float(scene.depth[row, column])
    if not depth > 0:
        raise InputError(f"The place {at[0]:g},{at[1]:g} is sky, where nothing can stand; choose a surface.")
    camera = scene.camera
    ray = rays_through(np.array(at), camera)
    point = ray * depth
    reach = radius if radius else picture_width(scene, depth) * DEFAULT.nearby
    near = _near(scene, point, reach, row, column)
    label = scene.geometry.plane_label[row, column]
    members = (scene.geometry.plane_label == label) & (scene.depth > 0) if label >= 0 else near
    normal = scene.normal[row, column].astype(np.float64)
    if members.sum() >= DEFAULT.fewest:
        normal = unit(np.median(scene.normal[members].astype(np.float64), axis=0))
    if near.sum() >= DEFAULT.fewest:
        points = unproject(scene.depth, camera)[near].astype(np.float64)
        offset = np.median(points @ normal)
        along = float(ray @ normal)
        if along < -0.05:  # a surface seen edge-on keeps the pixel's own point
            point = ray * np.clip(offset / along, 0.8 * depth, 1.25 * depth)
    return Support(point, normal, float(-point[2]))


def picture_width(scene: Scene, depth: float) -> float:
    """Width of what the picture shows at a planar depth, scene units."""
    return depth * scene.camera.width / scene.camera.focal


def _near(scene: Scene, point: Array, reach: float, row: int, column: int) -> Array:
    """[H, W] bool: pixels whose surface lies within `reach` of the point and faces about the same way."""
    points = unproject(scene.depth, scene.camera)
    close = ((points - point) ** 2).sum(-1) < reach**2
    window = np.s_[max(row - 2, 0) : row + 3, max(column - 2, 0) : column + 3]
    facing = unit(np.median(scene.normal[window].reshape(-1, 3), axis=0))
    return close & (scene.depth > 0) & (scene.normal @ facing > DEFAULT.alike)
