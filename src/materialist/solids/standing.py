"""The closed body of an object, set before what stands behind it.

Predicted depth melts the foot of a vase into the table, and things into the wall behind them: the body, as thick as it
is, would reach through both. Brought nearer to the camera, all of it by one factor, it looks the same and has its room.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from materialist.camera import pixel_rays, project
from materialist.solids.closed import closed_proxy
from materialist.solids.lathe import Lathed
from materialist.solids.shell import Shell
from materialist.types import Array, Camera

NEAREST = 0.75
"""Least factor by which a body is brought nearer."""
ENOUGH = 0.99
"""A factor from which on it stays where it is: the thickness is not known that well."""
BEYOND = 0.05
"""Share of a body's back that may stay behind what is seen behind it: masks and depths have their errors."""


class Thick(Protocol):
    """What is known of an object's thickness."""

    @property
    def solid(self) -> Array: ...  # [H, W] along the camera rays
    @property
    def back(self) -> Array | None: ...  # [H, W, 3] outward normals of the last surface
    @property
    def lathe(self) -> Lathed | None: ...  # all of the object


def standing_body(
    depth: Array, normal: Array, mask: Array, found: Thick, camera: Camera, *, behind: Array,
    wall: float | None = None, smooth: float = 0.01, open_top: bool = False,
) -> Shell:  # fmt: skip
    """The body of the lathe where there is one, else the closed proxy, before what stands behind it.

    Arguments and errors as of `closed.closed_proxy`; with `open_top` a hollow lathed body has no lid, where that can
    be. A wall is brought nearer with the body, by the same factor.
    """
    mask = np.asarray(mask) > 0.5
    if found.lathe is not None:
        body = found.lathe.body(camera, wall=wall, open_top=open_top)
        factor = nearer(body.vertices, mask, behind, camera)
        return body._replace(vertices=body.vertices * np.float32(factor))
    factor = room(depth, found.solid, mask, behind, camera)
    depth, solid = np.float32(factor) * depth, np.float32(factor) * found.solid
    wall = None if wall is None else factor * wall
    return closed_proxy(depth, normal, mask, solid, camera, smooth=smooth, wall=wall, behind=behind, back=found.back)


def room(depth: Array, thickness: Array, mask: Array, behind: Array, camera: Camera) -> float:
    """`nearer` of what is `thickness` [H, W] deep along the camera rays, from its front at planar `depth` [H, W] on."""
    rays = pixel_rays(camera)
    last = depth + thickness / np.linalg.norm(rays, axis=-1)
    return nearer((rays * last[..., None])[mask & (depth > 0)], mask, behind, camera)


def nearer(points: Array, mask: Array, behind: Array, camera: Camera) -> float:
    """The factor in [NEAREST, 1] that brings nearly all points [N, 3] before what stands behind.

    `behind` is its planar depth [H, W], 0: nothing; only points that are seen in the mask [H, W] bool count.
    """
    place, ahead = project(points, camera)
    column, row = np.floor(place).astype(int).T
    there = (ahead > 0) & (column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height)
    column, row, ahead = column[there], row[there], ahead[there]
    limit = behind[row, column]
    counts = (limit > 0) & mask[row, column]
    factor = float(np.quantile(limit[counts] / ahead[counts], BEYOND)) if counts.any() else 1.0
    return 1.0 if factor > ENOUGH else max(factor, NEAREST)
