"""The surface under a pixel, as something to stand on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays, unproject
from materialist.edits.core.region import checked_pixel
from materialist.errors import InputError
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SupportSettings:
    """Which pixels tell the plane that a thing stands on."""

    alike: float = 0.7
    """Cosine from which a neighbour's normal counts as that of the same surface (tuned by eye)."""
    fewest: int = 12
    """Pixels that a plane is fitted to, at least; with fewer the predicted normal decides (derived)."""
    nearby: float = 1 / 24
    """Radius around the place, share of the picture's width, where no radius is given (tuned by eye)."""
    spread: float = 1 / 6
    """Standard deviation of the weight of a dominant plane's pixels, share of the longer side (tuned by eye)."""


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

    On a dominant plane of the scene it is fitted to that plane's pixels, the near ones counting most, since predicted
    depth bends planes; elsewhere to the pixels within `radius` (scene units) whose normals are alike. Its place along
    the normal is the median of the surface within the radius.

    Raises InputError for a point outside the photo, or on the sky.
    """
    column, row = checked_pixel(scene, at, "place")
    depth = float(scene.depth[row, column])
    if not depth > 0:
        raise InputError(f"The place {at[0]:g},{at[1]:g} is sky, where nothing can stand; choose a surface.")
    camera = scene.camera
    ray = np.array(
        [(at[0] - camera.width / 2) / camera.focal, (camera.height / 2 - at[1]) / camera.focal, -1.0], np.float64
    )
    point = ray * depth
    reach = radius if radius else picture_width(scene, depth) * DEFAULT.nearby
    near = _near(scene, point, reach, row, column)
    label = scene.geometry.plane_label[row, column]
    members = (scene.geometry.plane_label == label) & (scene.depth > 0) if label >= 0 else near
    normal = scene.normal[row, column].astype(np.float64)
    if members.sum() >= DEFAULT.fewest:
        spread = max(camera.width, camera.height) * DEFAULT.spread if label >= 0 else np.inf
        normal = _fitted(scene, members, (row, column), spread)
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
    facing = np.median(scene.normal[window].reshape(-1, 3), axis=0)
    return (
        close & (scene.depth > 0) & (scene.normal @ facing > DEFAULT.alike * max(float(np.linalg.norm(facing)), 1e-6))
    )


def _fitted(scene: Scene, members: Array, pixel: tuple[int, int], spread: float) -> Array:
    """[3] unit normal of the plane through the members [H, W], by weighted least squares in inverse depth.

    Inverse depth is linear in the picture on a plane. `spread` is the standard deviation, in pixels, of the weight by
    nearness; three rounds leave out what lies off the plane.
    """
    rows, columns = np.nonzero(members)
    step = max(1, len(rows) // 20_000)
    rows, columns = rows[::step], columns[::step]
    rays = pixel_rays(scene.camera)[rows, columns].astype(np.float64)
    depth = scene.depth[rows, columns].astype(np.float64)
    weight = np.ones(len(rows))
    if np.isfinite(spread):
        away = ((rows - pixel[0]) ** 2 + (columns - pixel[1]) ** 2) / spread**2
        weight = np.exp(-0.5 * away) + 1e-3
    keep = weight.copy()
    coefficients = np.array([0.0, 0.0, -1.0])
    for _ in range(3):
        side = np.sqrt(keep)[:, None]
        # The relative depth error depth * (ray . c) - 1 is what is made small.
        coefficients = np.linalg.lstsq(rays * depth[:, None] * side, side[:, 0], rcond=None)[0]
        error = np.abs((rays @ coefficients) * depth - 1)
        scale = max(float(np.median(error)), 1e-5)
        keep = weight / (1 + (error / (3 * scale)) ** 2)
    normal = -coefficients / max(float(np.linalg.norm(coefficients)), 1e-12)
    return -normal if normal @ rays.mean(0) > 0 else normal
