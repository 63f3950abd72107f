"""A closed object from one view: its front, a back at the depth of its thickness, and the wall between.

The paper bends a camera ray twice at front normals and needs no back side. A closed surface can be path-traced:
reflections inside, total internal reflection, shadows and caustics then come by themselves. What light does at glass is
decided by normals, hardly by places: the front has those that are given, the back those that are known of it, else
those of planes fitted to its depth.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from materialist.camera import rays_through, unit
from materialist.errors import InputError
from materialist.geometry.membrane import membrane, nearest
from materialist.geometry.silhouette import (
    border_distance,
    silhouette_field,
    spacing,
    surface_in,
    window,
)
from materialist.geometry.slopes import SHARP, back_normals, blurred_normals, continued, sampled
from materialist.solids.shell import Shell, closed_shell, inside_out, joined_shells, region
from materialist.types import Array, Camera


@dataclass(frozen=True)
class ClosedSettings:
    """How the closed object is made of its front and its thickness."""

    frame_margin: int = 3  # pixels by which an object goes on beyond the frame: hides its wall
    grid_points: int = 300  # along a small object; larger objects have one a pixel
    max_points_per_pixel: int = 6  # grid points along a pixel
    min_grid_distance: float = 0.02  # pixels from outline to grid points: no tiny triangles
    max_back_depth: float = 0.995  # of the depth behind the object: the back stays before; by eye
    min_thickness: float = 0.004  # of the object's size: front and back never touch; by eye
    min_border_thickness: float = 1e-4  # the same at the border, part of the depth
    normal_blur: float = 0.01  # standard deviation, part of the object's size; tuned by eye
    outline_blur: float = 0.015  # the same for the outline: no ragged rim; by eye
    min_cosine: float = 0.35  # n.v from which a slanting wall gets no longer; tuned by eye


SETTINGS = ClosedSettings()
NOTHING = 1e9
"""Room behind an object with nothing there."""


def closed_proxy(
    depth: Array,
    normal: Array,
    mask: Array,
    thickness: Array,
    camera: Camera,
    *,
    wall: float | None = None,
    behind: Array | None = None,
    back: Array | None = None,
) -> Shell:
    """The closed object behind a mask; watertight: every edge has two faces that run through it in opposite directions.

    Args:
        depth: [H, W] planar depth of the front, scene units, 0 = none. normal: [H, W, 3] unit.
        mask: [H, W] bool or weights. Its parts become bodies of their own, its holes stay open (unless a pixel wide).
        thickness: [H, W] length of the camera ray inside the solid object, scene units >= 0.
        wall: the object is hollow: thickness of its wall, scene units. A second surface is added inside.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the back stays before it.
        back: [H, W, 3] unit normals of the back, outwards, where they are known better than by its depth.

    Raises InputError for a mask without a surface or too thin for one.
    """
    inside = surface_in(mask, depth, camera)
    view = _window(depth, normal, inside, thickness, behind, back, camera)
    view = replace(view, thickness=_thickness(view))
    shell = _closed(view, camera)
    if wall is None:
        return shell
    inner = _cavity(view, wall, camera)
    return shell if inner is None else joined_shells([shell, inside_out(inner)])


@dataclass(frozen=True)
class _View:
    """The part of the picture around the object, a few pixels beyond the frame included."""

    depth: Array
    normal: Array
    inside: Array
    thickness: Array
    behind: Array
    back: Array | None
    rays: Array
    """[h, w, 3] through the pixels at z = -1."""
    left: int
    top: int
    """Column and row of its first pixel in the picture (may be negative)."""

    @property
    def size(self) -> float:
        """Root of the object's area, pixels."""
        return float(np.sqrt(self.inside.sum()))

    @property
    def length(self) -> Array:
        """[h, w] of the rays."""
        return np.linalg.norm(self.rays, axis=-1)

    @property
    def pixel(self) -> Array:
        """[h, w] size of a pixel on the front, scene units."""
        return self.depth * spacing(self.rays)


def _window(depth, normal, inside, thickness, behind, back, camera: Camera) -> _View:
    margin = SETTINGS.frame_margin
    edge = margin + 1
    rows, columns = window(inside)
    y = np.arange(rows.start - edge, rows.stop + edge)
    x = np.arange(columns.start - edge, columns.stop + edge)
    # Beyond the frame everything goes on as at its edge, for some pixels.
    i = np.clip(y, 0, camera.height - 1)[:, None]
    j = np.clip(x, 0, camera.width - 1)[None]
    # Within the margin the object goes on; beyond it the view is empty.
    near = ((y >= -margin) & (y < camera.height + margin))[:, None] & (
        (x >= -margin) & (x < camera.width + margin)
    )
    rays = rays_through(np.stack(np.meshgrid(x, y), -1) + 0.5, camera)
    beyond = np.zeros(inside.shape) if behind is None else behind
    return _View(
        depth[i, j],
        normal[i, j],
        inside[i, j] & near,
        thickness[i, j],
        beyond[i, j],
        None if back is None else back[i, j],
        rays,
        int(x[0]),
        int(y[0]),
    )


def _thickness(view: _View) -> Array:
    """[h, w] along the ray, scene units: never behind what stands there, and never none."""
    least = SETTINGS.min_thickness * view.size * np.median(view.pixel[view.inside])
    thick = np.minimum(view.thickness.astype(np.float64), _room(view))
    return np.where(view.inside, np.maximum(thick, least), 0)


def _cavity(view: _View, wall: float, camera: Camera) -> Shell | None:
    """The surface `wall` below that of the object; None where the object has no room for it."""
    facing = np.abs((view.normal * view.rays).sum(-1)) / view.length
    through = wall / np.clip(facing, SETTINGS.min_cosine, 1)  # [h, w] along the ray, of one wall
    # Room inside: two walls along the ray, and one from the silhouette.
    left = view.thickness - 2 * through
    room = view.inside & (left > SETTINGS.min_thickness * view.size * view.pixel)
    room &= border_distance(view.inside) * view.pixel > wall
    if room.sum() < 16:
        return None
    # Its walls are parallel: the same normals.
    front = view.depth + through / view.length
    return _closed(
        replace(view, inside=room, depth=front, thickness=np.where(room, left, 0)), camera
    )


def _closed(view: _View, camera: Camera) -> Shell:
    """Front and back over one triangulated region."""
    known = view.inside
    length = view.length
    front = view.depth
    thick = view.thickness
    # --- The outline, triangulated on a grid finer than the pixels of a small object ---
    silhouette_distance = gaussian_filter(
        silhouette_field(known), SETTINGS.outline_blur * view.size
    )  # [h, w] pixels
    points_per_pixel = int(
        np.clip(round(SETTINGS.grid_points / max(known.shape)), 1, SETTINGS.max_points_per_pixel)
    )
    height, width = known.shape
    upsampled_distance = cv2.resize(
        silhouette_distance.astype(np.float32),
        (width * points_per_pixel, height * points_per_pixel),
        interpolation=cv2.INTER_LINEAR,
    )
    points, faces = region(_closed_at_border(upsampled_distance))
    if not len(faces):
        raise InputError(
            "The mask is too thin to give a body; mark an object that is some pixels wide."
        )
    pixel_xy = (points + 0.5) / points_per_pixel - 0.5  # [V, 2] pixels of the view

    def at_points(values):
        return sampled(values, pixel_xy, order=1)

    # --- Front depth and thickness at the vertices ---
    # Near a rounded silhouette thickness falls like sqrt(distance), so thickness² is linear there:
    # extrapolate thickness² and the mid-surface depth, not front and back.
    log_middle = continued(np.log(np.where(known, front + thick / (2 * length), 1)), known)
    squared_thickness = np.minimum(continued(thick**2, known), 2 * thick.max() ** 2)
    through = np.sqrt(np.maximum(at_points(squared_thickness), 0))
    front_depth = np.exp(at_points(log_middle)) - through / (2 * at_points(length))
    through = np.maximum(
        np.minimum(through, at_points(_room(view))), SETTINGS.min_border_thickness * front_depth
    )

    # --- Normals: of the map in front; of the back's own map, or of its depth ---
    sigma = SETTINGS.normal_blur * view.size
    if view.back is None:
        back = back_normals(front + thick / length, known, view.rays, max(sigma, SHARP))
    else:
        back = blurred_normals(view.back, known, sigma)
    normals = (
        _between(blurred_normals(view.normal, known, sigma), known, pixel_xy),
        _between(back, known, pixel_xy),
    )

    # --- The wall between them faces down the slope of the outline's distance field ---
    down, right = np.gradient(silhouette_distance)
    outward = np.stack([-at_points(right), -at_points(down)], -1)
    return closed_shell(
        faces,
        pixel_xy + np.array([view.left, view.top]),
        front_depth,
        through,
        normals,
        outward,
        camera,
    )


def _between(normal: Array, known: Array, pixel_xy: Array) -> Array:
    """[V, 3] unit normals at points [V, 2] of a map [h, w, 3], the nearest known ones beyond the mask."""
    return unit(sampled(normal[nearest(known)], pixel_xy))


def _room(view: _View) -> Array:
    """[h, w] length of the ray between the front and what stands behind, scene units."""
    known = view.inside & (view.behind > 0)
    room = np.where(
        known,
        np.maximum(SETTINGS.max_back_depth * view.behind - view.depth, 0) * view.length,
        NOTHING,
    )
    # Next to the mask the values are those of the last pixels in it.
    return membrane(room, view.inside)


def _closed_at_border(distance: Array) -> Array:
    """The distance field with its outermost points negative, and none so near 0 that the outline meets a grid point."""
    closed = distance.copy()
    closed[[0, -1]] = np.minimum(closed[[0, -1]], -1)
    closed[:, [0, -1]] = np.minimum(closed[:, [0, -1]], -1)
    return np.copysign(np.maximum(np.abs(closed), SETTINGS.min_grid_distance), closed)
