"""A closed object from one view: the visible front, a back at the depth of its thickness, and a round rim.

The paper bends a camera ray twice at front normals and needs no back side. A closed surface can be path-traced:
reflections inside, total internal reflection, shadows and caustics then come by themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from materialist.errors import InputError
from materialist.geometry.contour import Region, region, silhouette_field
from materialist.geometry.front import smooth_front
from materialist.geometry.membrane import membrane
from materialist.geometry.shell import Shell, joined, turned, vertex_normals
from materialist.geometry.symmetry import border_distance, spacing, surface_in
from materialist.types import Array, Camera

MARGIN = 3
"""Pixels by which an object that the frame cuts goes on beyond it: the wall that closes it stays out of view."""
GRID = 300
"""Grid points along a small object; larger ones have one a pixel."""
COLLAR = 0.35
"""Pixels between the last vertices of front and back and the silhouette, bridged by the round rim."""
RINGS = 4
"""Rings of the rim, from the front's last vertices to the silhouette; as many on the way back."""
ROUND = 1.6
"""A body is nowhere thicker than this many times one with a round section as wide: towards the silhouette a
thickness that was guessed then ends as that of a round thing does."""
NEAREST = 0.995
"""The back keeps before this part of the depth of what stands behind the object."""
NOTHING = 1e9
"""Room behind an object with nothing there."""
THIN = 0.004
"""Least thickness, as a part of the object's size: front and back never touch."""


def closed_proxy(
    depth: Array, normal: Array, mask: Array, thickness: Array, camera: Camera, *, smooth: float = 0.01,
    wall: Array | float | None = None, behind: Array | None = None,
) -> Shell:  # fmt: skip
    """The closed object behind a mask.

    Args:
        depth: [H, W] planar depth of the front, scene units, 0 = none.
        normal: [H, W, 3] unit; the front follows them (see `front.smooth_front`).
        mask: [H, W] bool or weights. Its parts become bodies of their own, its holes stay open (unless a pixel wide).
        thickness: [H, W] length of the camera ray inside the solid object, scene units >= 0.
        smooth: blur of normals and thickness, as a part of the object's size (the root of its area); 0 for none.
        wall: the object is hollow: thickness of its wall, scene units, or [H, W]. A second surface is added inside.
        behind: [H, W] planar depth of what stands behind the object, 0 = nothing: the back stays before it.

    Returns:
        A watertight surface: every edge has two faces that run through it in opposite directions.

    Raises:
        InputError: shapes that differ, a thickness that is negative or not finite, or a mask without a surface or too
            thin for one.
    """
    inside = surface_in(mask, depth, camera)
    _check(normal, thickness, inside)
    view = _window(depth, normal, inside, thickness, behind, camera)
    front = smooth_front(view.depth, view.normal, view.inside, view.rays, smooth=smooth)
    squared = _squared_thickness(view, front, smooth)  # [h, w]
    shell = _closed(view, front, squared, camera)
    if wall is None:
        return shell
    inner = _cavity(view, front, squared, wall, camera)
    return shell if inner is None else joined([shell, turned(inner)])


@dataclass(frozen=True)
class _View:
    """The part of the picture around the object, a few pixels beyond the frame included."""

    depth: Array
    normal: Array
    inside: Array
    thickness: Array
    behind: Array
    rays: Array
    """[h, w, 3] through the pixels at z = -1."""
    left: int
    top: int
    """Column and row of its first pixel in the picture (may be negative)."""

    @property
    def size(self) -> float:
        """Root of the object's area, pixels."""
        return float(np.sqrt(self.inside.sum()))


def _check(normal: Array, thickness: Array, inside: Array) -> None:
    if normal.shape != (*inside.shape, 3) or np.shape(thickness) != inside.shape:
        raise InputError(
            f"The normals are {normal.shape} and the thickness {np.shape(thickness)}; the mask is {inside.shape}."
        )
    own = np.asarray(thickness)[inside]
    if not (np.isfinite(own).all() and own.min() >= 0 and own.max() > 0):
        raise InputError(f"The thickness goes from {own.min():g} to {own.max():g}; it must be finite, >= 0, not all 0.")


def _window(depth, normal, inside, thickness, behind, camera: Camera) -> _View:
    edge = MARGIN + 1
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    top, left = rows[0] - edge, columns[0] - edge
    bottom, right = rows[-1] + edge + 1, columns[-1] + edge + 1
    y, x = np.arange(top, bottom), np.arange(left, right)
    # Beyond the frame everything goes on as at its edge, for MARGIN pixels.
    i, j = np.clip(y, 0, camera.height - 1)[:, None], np.clip(x, 0, camera.width - 1)[None]
    near = ((y >= -MARGIN) & (y < camera.height + MARGIN))[:, None] & ((x >= -MARGIN) & (x < camera.width + MARGIN))
    rays = np.stack(
        np.broadcast_arrays(
            ((x + 0.5 - camera.width / 2) / camera.focal)[None],
            ((camera.height / 2 - y - 0.5) / camera.focal)[:, None], np.array(-1.0),
        ), -1,
    )  # fmt: skip
    back = np.zeros(inside.shape) if behind is None else np.asarray(behind)
    return _View(
        np.asarray(depth)[i, j], np.asarray(normal)[i, j], inside[i, j] & near, np.asarray(thickness)[i, j],
        back[i, j], rays, int(left), int(top),
    )  # fmt: skip


def _squared_thickness(view: _View, front: Array, smooth: float) -> Array:
    """[h, w] square of the thickness, scene units^2: near a round rim it grows evenly, so that blurs keep its shape."""
    from scipy.ndimage import gaussian_filter

    inside = view.inside
    sigma = 2 * smooth * view.size
    squared = np.where(inside, view.thickness, 0).astype(np.float64) ** 2
    if sigma > 0.3:
        weight = gaussian_filter(inside.astype(np.float64), sigma)
        squared = np.where(inside, gaussian_filter(squared, sigma) / np.maximum(weight, 1e-9), 0)
    pixel = front * spacing(view.rays)  # scene units
    border = border_distance(inside)
    widest = float(border[inside].max())
    rounded = (2 * ROUND * pixel) ** 2 * border * (2 * widest - border)
    squared = np.minimum(squared, rounded)
    squared = np.minimum(squared, _room(view, front) ** 2)
    least = THIN * view.size * np.median(pixel[inside])
    return np.where(inside, np.maximum(squared, least**2), 0)


def _cavity(view: _View, front: Array, squared: Array, wall, camera: Camera) -> Shell | None:
    """The surface `wall` below that of the object; None where the object has no room for it."""
    length = np.linalg.norm(view.rays, axis=-1)
    facing = np.abs((view.normal * view.rays).sum(-1)) / length
    if np.ndim(wall):
        rows, columns = np.arange(front.shape[0]) + view.top, np.arange(front.shape[1]) + view.left
        wall = np.asarray(wall)[
            np.clip(rows, 0, camera.height - 1)[:, None], np.clip(columns, 0, camera.width - 1)[None]
        ]
    through = wall / np.clip(facing, 0.35, 1)  # [h, w] along the ray, of one wall
    left = np.sqrt(squared) - 2 * through
    pixel = front * spacing(view.rays)
    room = view.inside & (left > THIN * view.size * pixel) & (border_distance(view.inside) * pixel > wall)
    if room.sum() < 16:
        return None
    inner = _View(view.depth, view.normal, room, left, view.behind, view.rays, view.left, view.top)
    return _closed(inner, front + through / length, np.where(room, np.maximum(left, 0) ** 2, 0), camera)


def _closed(view: _View, front: Array, squared: Array, camera: Camera) -> Shell:
    """Front and back over one triangulated region, and the rim between them."""
    import cv2

    factor = int(np.clip(round(GRID / max(view.inside.shape)), 1, 4))
    height, width = view.inside.shape
    # Values beyond the mask: what is near goes on, so that the silhouette, between pixels, has some.
    known = view.inside
    edge = silhouette_field(view.inside)  # [h, w] pixels
    steady = _steady(squared, edge, known)
    length = np.linalg.norm(view.rays, axis=-1)
    # Towards a silhouette front and back turn away, and the middle between them does not: it can be carried on.
    middle = front + np.sqrt(np.maximum(steady * np.maximum(edge, 0), 0)) / (2 * length)
    maps = np.log(np.maximum(membrane(middle, known), 1e-9)), steady, edge, length
    size = (width * factor, height * factor)
    field = cv2.resize((edge - COLLAR).astype(np.float32), size, interpolation=cv2.INTER_LINEAR)
    found = region(_ended(field))
    if not len(found.faces):
        raise InputError("The mask is too thin to give a body; mark an object that is some pixels wide.")
    place = (found.points + 0.5) / factor - 0.5  # [V, 2] (x, y) pixels of the view
    log_middle, steady, edge, length = (_sampled(values, place) for values in maps)
    thick = np.sqrt(np.maximum(steady, 0) * np.maximum(edge, COLLAR))
    own = np.exp(log_middle) - thick / (2 * length)
    thick = np.minimum(thick, _sampled(_room(view, front), place, order=1))
    return _assembled(found, place, own, thick, view, camera)


def _steady(squared: Array, edge: Array, known: Array) -> Array:
    """[h, w] square of the thickness over the distance to the silhouette, which changes slowly and can be carried on.

    Next to the silhouette, which the mask gives to half a pixel only, it is the ratio of the two's means nearby.
    """
    from scipy.ndimage import gaussian_filter

    mean = lambda v: gaussian_filter(np.where(known, v, 0).astype(np.float64), 1.5)  # noqa: E731
    away = np.maximum(edge, 0.3)
    deep = np.clip((edge - 1.5) / 3, 0, 1)
    return membrane(deep * squared / away + (1 - deep) * mean(squared) / np.maximum(mean(away), 1e-9), known)


def _room(view: _View, front: Array) -> Array:
    """[h, w] length of the ray between the front and what stands behind, scene units."""
    length = np.linalg.norm(view.rays, axis=-1)
    known = view.inside & (view.behind > 0)
    room = np.where(known, np.maximum(NEAREST * view.behind - front, 0) * length, NOTHING)
    # Next to the mask the values are those of the last pixels in it.
    return membrane(room, view.inside)


def _sampled(values: Array, place: Array, order: int = 3) -> Array:
    """[V] of a map [h, w] at places [V, 2], by a cubic spline: between pixels, too, the normals turn evenly."""
    from scipy.ndimage import map_coordinates

    return np.asarray(map_coordinates(values.astype(np.float64), place.T[::-1], order=order, mode="nearest"))


def _ended(field: Array) -> Array:
    """The field with its outermost points negative."""
    field[[0, -1]], field[:, [0, -1]] = np.minimum(field[[0, -1]], -1), np.minimum(field[:, [0, -1]], -1)
    # No crossing exactly on a grid point.
    return np.where(np.abs(field) < 1e-4, 1e-4, field)


def _assembled(found: Region, place: Array, front: Array, thick: Array, view: _View, camera: Camera) -> Shell:
    """Two sheets over the region, its border bridged by rings; `front` planar and `thick` along the ray, [V]."""
    count = len(place)
    number = np.full(count, -1, np.int64)
    rim = np.unique(found.border)
    number[rim] = np.arange(len(rim))
    edges = number[found.border]  # [B, 2] in vertices of the rim
    outward = _outward(place[rim], edges)
    turns = np.linspace(1, -1, 2 * RINGS + 1)[1:-1]  # 1 at the front's last vertices, 0 at the silhouette
    ring_place = place[rim] + COLLAR * (1 - turns[:, None, None] ** 2) * outward  # [R, B, 2]
    all_place = np.concatenate([place, place, ring_place.reshape(-1, 2)])
    all_front = np.concatenate([front, front, np.tile(front[rim], len(turns))])
    half = thick[rim] / 2
    depth_in = np.concatenate([np.zeros(count), thick, ((1 - turns)[:, None] * half).ravel()])
    vertices, uv = _in_space(all_place, all_front, depth_in, view, camera)
    # Rings in order, from the front's own vertices to the back's.
    rings = [rim, *(2 * count + k * len(rim) + np.arange(len(rim)) for k in range(len(turns))), rim + count]
    strips = [_strip(one, two, edges) for one, two in pairwise(rings)]
    faces = np.concatenate([found.faces, found.faces[:, ::-1] + count, *strips])
    return Shell(vertices.astype(np.float32), faces.astype(np.int32), vertex_normals(vertices, faces), uv)


def _strip(one: Array, two: Array, edges: Array) -> Array:
    """[2B, 3] faces between two rings (vertex numbers), along edges [B, 2] of the sheet that `one` ends."""
    a, b = edges.T
    return np.concatenate([np.stack([one[b], one[a], two[a]], -1), np.stack([one[b], two[a], two[b]], -1)])


def _outward(points: Array, edges: Array) -> Array:
    """[R, 2] unit directions (y down) away from the region at its border's points [R, 2]."""
    along = points[edges[:, 1]] - points[edges[:, 0]]
    # The region lies to the left of its edges seen with y up: outside is to the right.
    side = np.stack([-along[:, 1], along[:, 0]], -1)
    side /= np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)
    total = np.zeros_like(points)
    for k in range(2):
        np.add.at(total, edges[:, k], side)
    return total / np.maximum(np.linalg.norm(total, axis=-1, keepdims=True), 1e-9)


def _in_space(place: Array, front: Array, beyond: Array, view: _View, camera: Camera) -> tuple[Array, Array]:
    """[N, 3] points on the rays through `place` [N, 2], `beyond` [N] along the ray behind planar depth `front` [N]."""
    column, row = place[:, 0] + view.left + 0.5, place[:, 1] + view.top + 0.5
    rays = np.stack(
        [(column - camera.width / 2) / camera.focal, (camera.height / 2 - row) / camera.focal, -np.ones(len(row))], -1
    )
    points = rays * (front + beyond / np.linalg.norm(rays, axis=-1))[:, None]
    return points, np.clip(np.stack([column / camera.width, row / camera.height], -1), 0, 1).astype(np.float32)
