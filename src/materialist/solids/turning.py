"""The visible front of an object, turned around an axis to where its back may be, drawn into the picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from materialist.geometry.membrane import membrane
from materialist.solids.symmetry import spacing
from materialist.types import Array

FINE = 3
"""Points along a pixel when the turned front is drawn."""
LEAVING = 0.02
"""Least cosine between a ray and the normal at which it leaves: a turned surface that faces the camera is no back."""
STEEP = 0.15
"""The same, above which the depth at the centre of a pixel is that of the tangent plane of a point in it."""
NEAR = 0.02
"""How far a tangent plane may take the depth away from that of the point, relative."""
LAYER = 1.5
"""Points within this many pixels of the deepest one are of one surface."""


@dataclass(frozen=True)
class Axis:
    """What an object is turned around, and whether it ends at a flat base."""

    up: Array
    """[3] unit."""
    foot: Array
    """[3] scene units."""
    base: bool
    """Whether the object ends at a plane through `foot`."""

    def turned(self, points: Array, angle: float = np.pi) -> Array:
        """[N, 3] points after a turn by `angle` radians."""
        return self.spun(points - self.foot, angle) + self.foot

    def spun(self, directions: Array, angle: float = np.pi) -> Array:
        """[N, 3] directions after the turn."""
        along = (directions @ self.up)[:, None] * self.up
        cosine, sine = np.cos(angle), np.sin(angle)
        return cosine * directions + sine * np.cross(self.up, directions) + (1 - cosine) * along

    def base_depth(self, rays: Array) -> Array:
        """[...] planar depth at which rays [..., 3] (z = -1) pass the base downwards; inf where they do not."""
        falling = rays @ self.up
        reached = float(self.foot @ self.up) / np.where(falling < -1e-6, falling, -1e-6)
        return np.where(self.base & (falling < -1e-6) & (reached > 0), reached, np.inf)


def turned_thickness(
    depth: Array, normal: Array, inside: Array, rays: Array, axis: Axis, angles: Sequence[float] = (np.pi,)
) -> Array:
    """[H, W] float32 along the rays, scene units: to the front turned by each angle, gaps spanned, cut at the base.

    Args:
        depth: [H, W] planar, scene units. normal: [H, W, 3] unit. inside: [H, W] bool, where both are known.
        rays: [H, W, 3] through the pixels at z = -1, evenly spaced. angles: radians; pi alone for a half turn.
    """
    exits = _drawn(depth, normal, inside, rays, axis, angles)
    drawn = inside & (exits > 0)
    length = np.linalg.norm(rays, axis=-1)
    if axis.base:
        # The walls go on down to the base.
        exits = np.minimum(membrane(exits, drawn), axis.base_depth(rays))
        squared = np.maximum((exits - depth) * length, 0) ** 2
    else:
        # At a silhouette that turns away the thickness ends; squares change evenly there.
        squared = membrane(np.maximum((exits - depth) * length, 0) ** 2, drawn | ~inside)
    return np.where(inside, np.sqrt(np.maximum(squared, 0)), 0).astype(np.float32)


def _drawn(depth: Array, normal: Array, inside: Array, rays: Array, axis: Axis, angles: Sequence[float]) -> Array:
    """[H, W] planar depth of the deepest turned surface at the centre of each pixel, 0 for none."""
    points, normals = _points(depth, normal, inside, rays)
    turned = [_in_pixels(axis.turned(points, k), axis.spun(normals, k), rays) for k in angles]
    row, column, own, centre = (np.concatenate(parts) for parts in zip(*turned, strict=True))
    deepest = np.zeros(depth.shape)
    np.maximum.at(deepest, (row, column), own)
    near = own > deepest[row, column] - LAYER * spacing(rays) * own
    place = row[near] * depth.shape[1] + column[near]
    count = np.bincount(place, minlength=depth.size)
    total = np.bincount(place, centre[near], minlength=depth.size)
    return (total / np.maximum(count, 1)).reshape(depth.shape)


def _points(depth: Array, normal: Array, inside: Array, rays: Array) -> tuple[Array, Array]:
    """[N, 3] points of the front, FINE x FINE a pixel, and their unit normals."""
    import cv2

    log_depth = membrane(np.log(np.where(inside, depth, 1)), inside).astype(np.float32)
    spread = membrane(np.where(inside[..., None], normal, 0).astype(np.float32), inside)
    larger = lambda values: cv2.resize(values, None, fx=FINE, fy=FINE, interpolation=cv2.INTER_LINEAR)  # noqa: E731
    i, j = np.nonzero(np.kron(inside, np.ones((FINE, FINE), bool)))
    step = spacing(rays)
    right = rays[0, 0, 0] + ((j + 0.5) / FINE - 0.5) * step
    above = rays[0, 0, 1] - ((i + 0.5) / FINE - 0.5) * step
    z = np.exp(larger(log_depth)[i, j].astype(np.float64))
    normals = larger(spread)[i, j].astype(np.float64)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    return np.stack([right, above, -np.ones(len(i))], -1) * z[:, None], normals


def _in_pixels(points: Array, normals: Array, rays: Array) -> tuple[Array, Array, Array, Array]:
    """Row, column, planar depth, and depth of the tangent plane at the pixel's centre, of points that face away."""
    z = np.maximum(-points[:, 2], 1e-9)
    step = spacing(rays)
    column = np.round((points[:, 0] / z - rays[0, 0, 0]) / step).astype(int)
    row = np.round((rays[0, 0, 1] - points[:, 1] / z) / step).astype(int)
    there = (column >= 0) & (column < rays.shape[1]) & (row >= 0) & (row < rays.shape[0])
    row, column, z, points, normals = row[there], column[there], z[there], points[there], normals[there]
    ray = rays[row, column]
    facing = (normals * ray).sum(-1)
    cosine = facing / np.linalg.norm(ray, axis=-1)
    plane = (normals * points).sum(-1) / np.where(cosine > STEEP, facing, 1)
    centre = np.where(cosine > STEEP, np.clip(plane, (1 - NEAR) * z, (1 + NEAR) * z), z)
    away = cosine > LEAVING
    return row[away], column[away], z[away], centre[away]
