"""What was turned on a lathe, as one profile swept around its axis: from what is seen of it, and to a closed body.

Every visible point says where the profile is and how it leans, every ray that passes the object, or comes to its front,
says where the profile is not, whatever turn brings it there. So the inner side of a ring and the underside of a
shoulder are known, which maps of front and back have no place for.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from materialist.camera import project
from materialist.solids.profile import Profile, fitted
from materialist.solids.shell import Shell, joined, turned
from materialist.solids.turning import Axis
from materialist.solids.vessel import vessel
from materialist.types import Array, Camera

CELLS = 180
"""Cells of the profile's plane along the object."""
RAYS, BLOCK = 6000, 4096
"""Rays, at most, that tell where the object is not, and rays that are followed at once: bounds on memory."""
AROUND = 256
"""Corners of the swept circles."""
NEAR = 6
"""Pixels around the object whose rays tell where it is not."""
BEFORE = 1.5
"""Cells before the front at which rays are free for certain."""
SUNK, AIR = 0.3, 0.004
"""Parts of its height that an object reaches below what is seen of it, at most, and stays above the ground."""
OFF, THROUGH = 1.5, 0.03
"""Root mean square distance (cells) of the front from the profile, and the share of it just below which rays pass
freely, up to which an object is of one profile."""


@dataclass(frozen=True)
class Meridian:
    """Points of the half plane beside the axis: distance from it and height above its foot, scene units."""

    axis: Axis

    def of(self, points: Array) -> Array:
        """[..., 2] (distance, height) of points [..., 3]."""
        away = points - self.axis.foot
        height = away @ self.axis.up
        return np.stack([np.linalg.norm(away - height[..., None] * self.axis.up, axis=-1), height], -1)

    def leaning(self, points: Array, normals: Array) -> Array:
        """[N, 2] unit normals of the profile at points [N, 3] with normals [N, 3]."""
        found = np.stack([(normals * self._out(points)).sum(-1), normals @ self.axis.up], -1)
        return found / np.maximum(np.linalg.norm(found, axis=-1, keepdims=True), 1e-9)

    def spread(self, points: Array, leaning: Array) -> Array:
        """[N, 3] unit normals at points [N, 3] where the profile leans by [N, 2]."""
        found = leaning[:, :1] * self._out(points) + leaning[:, 1:] * self.axis.up
        return found / np.maximum(np.linalg.norm(found, axis=-1, keepdims=True), 1e-12)

    def _out(self, points: Array) -> Array:
        """[N, 3] unit, across the axis, to points [N, 3]."""
        away = points - self.axis.foot
        out = away - (away @ self.axis.up)[:, None] * self.axis.up
        return out / np.maximum(np.linalg.norm(out, axis=-1, keepdims=True), 1e-12)


def profile_of(
    depth: Array, normal: Array, inside: Array, rays: Array, axis: Axis, behind: Array | None = None
) -> Profile:
    """The profile of an object turned around an axis.

    Args:
        depth: [H, W] planar depth of the front, scene units. normal: [H, W, 3] unit. inside: [H, W] bool, where both
            are known. rays: [H, W, 3] through the pixels at z = -1.
        behind: [H, W] planar depth of what stands behind, 0 = nothing: the body stays above the lowest of it.
    """
    points, plane = (rays * depth[..., None])[inside], Meridian(axis)
    seen = plane.of(points)
    wide, high, low = float(seen[:, 0].max()), float(np.ptp(seen[:, 1])), float(seen[:, 1].min())
    cell = max(2 * wide, high) / CELLS
    ground = ground_height(axis, behind, inside, rays) + AIR * high
    floor = low if axis.base and not np.isfinite(ground) else max(low - SUNK * high, ground)
    passed = _passed(depth, inside, rays, plane, (wide, high), cell)
    return fitted(seen, plane.leaning(points, normal[inside]), passed, cell, floor)


def fits(profile: Profile) -> bool:
    """Whether one profile is all that is seen."""
    return profile.off <= OFF and profile.through <= THROUGH


def thickness_of(profile: Profile, axis: Axis, depth: Array, inside: Array, rays: Array) -> Array:
    """[H, W] float32 scene units along the rays: from the front [H, W] planar depth to the last surface of the body."""
    ray = rays[inside]
    reach = 2.5 * max(float(profile.seen[:, 0].max()), float(np.ptp(profile.seen[:, 1])))
    steps = np.arange(0, reach, profile.cell)
    last = np.zeros(len(ray))
    for part, values in along(profile, axis, ray, depth[inside], steps):
        inner = values < 0
        k = inner.shape[1] - 1 - inner[:, ::-1].argmax(1)
        row, after = np.arange(len(inner)), np.minimum(k + 1, inner.shape[1] - 1)
        before, beyond = values[row, k], values[row, after]
        share = np.where(beyond > before, -before / np.maximum(beyond - before, 1e-12), 0)
        last[part] = np.where(inner.any(1), steps[k] + np.clip(share, 0, 1) * profile.cell, 0)
    found = np.zeros(depth.shape, np.float32)
    found[inside] = last
    return found


def along(profile: Profile, axis: Axis, ray: Array, first: Array, steps: Array) -> Iterator[tuple[slice, Array]]:
    """Values [n, S] of the profile's function on rays [N, 3], some at once, from planar depth `first` [N] on.

    steps: [S] scene units along the rays.
    """
    plane, length = Meridian(axis), np.linalg.norm(ray, axis=-1)
    for k in range(0, len(ray), BLOCK):
        part = slice(k, k + BLOCK)
        at = first[part, None] + steps / length[part, None]
        yield part, profile.at(plane.of(ray[part, None] * at[..., None]))


def swept(profile: Profile, axis: Axis, camera: Camera, *, wall: float | None = None, open_top: bool = False) -> Shell:
    """The closed body of a profile; with `wall` (scene units) a second surface is added inside.

    With `open_top`, too, both are one: a vessel without a lid, where `vessel.vessel` makes one of the profile. Every
    edge has two faces that run through it in opposite directions.
    """
    line = vessel(profile, wall) if wall and open_top else None
    if line is not None:
        return _sheet(*line, axis, camera)
    outer = _sheets(profile, axis, 0.0, camera)
    inner = _sheets(profile, axis, wall, camera) if wall else []
    return joined([*outer, *(turned(sheet) for sheet in inner)])


def ground_height(axis: Axis, behind: Array | None, inside: Array, rays: Array) -> float:
    """Height above the foot of the lowest of what stands behind the object; -inf where there is nothing."""
    if behind is None or not (known := inside & (np.asarray(behind) > 0)).any():
        return -np.inf
    points = rays[known] * np.asarray(behind)[known][:, None]
    return float(np.percentile((points - axis.foot) @ axis.up, 2))


def _passed(
    depth: Array, inside: Array, rays: Array, plane: Meridian, extent: tuple[float, float], cell: float
) -> Array:  # fmt: skip
    """[M, 2] places of the half plane that rays pass before they meet anything."""
    import cv2

    near = cv2.dilate(inside.astype(np.uint8), np.ones((2 * NEAR + 1,) * 2, np.uint8)) > 0
    stride = max(1, int(near.sum()) // RAYS)
    front, ray = np.where(inside, depth - BEFORE * cell, np.inf)[near][::stride], rays[near][::stride]
    length = np.linalg.norm(ray, axis=-1)
    # Along the rays, through the ball around the object.
    reach = 1.2 * float(np.hypot(*extent))
    middle = plane.axis.foot + extent[1] / 2 * plane.axis.up
    nearest = (ray @ middle) / length**2
    at = nearest[:, None] + np.arange(-reach, reach, 0.7 * cell) / length[:, None]  # [N, S] planar depth
    free = at < front[:, None]
    return plane.of((ray[:, None] * at[..., None])[free])


def _sheets(profile: Profile, axis: Axis, level: float, camera: Camera) -> list[Shell]:
    """The surfaces that the border of what lies deeper than `level` describes."""
    return [_sheet(*line, axis, camera) for line in profile.lines(level)]


def _sheet(line: Array, leaning: Array, axis: Axis, camera: Camera) -> Shell:
    """One line [K, 2] with normals [K, 2], the body to its left, swept around the axis; ends at the axis are poles."""
    first = np.cross(axis.up, [0.0, 0, 1] if abs(axis.up[2]) < 0.9 else [1.0, 0, 0])
    first /= np.linalg.norm(first)
    angle = 2 * np.pi * np.arange(AROUND) / AROUND
    out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * np.cross(axis.up, first)  # [A, 3]
    closed = bool(np.allclose(line[0], line[-1]))
    rows = line[:-1] if closed else line
    lean = leaning[:-1] if closed else leaning
    points = axis.foot + rows[:, None, :1] * out + rows[:, None, 1:] * axis.up  # [K, A, 3]
    normals = lean[:, None, :1] * out + lean[:, None, 1:] * axis.up
    index = np.arange(points.shape[0] * AROUND).reshape(-1, AROUND)
    if not closed:  # a pole is one vertex
        index[0], index[-1] = index[0, 0], index[-1, 0]
    below, above = (index, np.roll(index, -1, 0)) if closed else (index[:-1], index[1:])
    a, b, c, d = below, np.roll(below, -1, 1), np.roll(above, -1, 1), above
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    used, faces = np.unique(faces, return_inverse=True)
    vertices, normals = points.reshape(-1, 3)[used], normals.reshape(-1, 3)[used]
    place = project(vertices, camera)[0] / [camera.width, camera.height]
    return Shell(
        vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.int32), normals.astype(np.float32),
        np.clip(place, 0, 1).astype(np.float32),
    )  # fmt: skip
