"""Rims of objects: their free outline moved back to where the surface, going on as its normals say, reaches it.

The last pixel before an outline has a depth step to its neighbour inside that is too small for where a round surface
turns away, so that its face looks more to the camera than its normal. While objects are open behind, nobody notices;
closed ones would cut off the light that reaches their rim from the side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.boundary import BEHIND
from materialist.geometry.objects import Objects
from materialist.types import Array, Camera, Mesh

_OFFSETS = np.array([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]])
"""[4, 2] from a pixel's centre to its corners in reading order: right, down."""


def set_back_rims(mesh: Mesh, objects: Objects, thickness: Array, depth: Array, normal: Array, camera: Camera) -> Mesh:
    """Move the vertices of free outlines along their camera rays, away from the camera.

    mesh: from `depth_to_mesh`, whose faces come first; `objects` belong to it. thickness: [H, W] length of the camera
    ray in each object, scene units: no rim moves beyond its middle. depth: [H, W] planar. normal: [H, W, 3] unit.

    A vertex goes where the planes through the object's pixels beside it, by their normals, have it; it stays before
    what is behind it, and where it is if it has pixels of other surfaces, too.
    """
    rim = np.unique(objects.border[objects.free])
    if not len(rim):
        return mesh
    inverse = -1 / mesh.vertices[:, 2].astype(np.float64)  # [V]
    inside = (objects.label >= 0) & np.isin(objects.corner, rim).any(-1)
    wanted = _tangent(inside, thickness, depth, normal, camera)  # [N, 4] inverse depth at the corners of those pixels
    count = len(inverse)
    ids = objects.corner[inside].ravel()
    pixels = np.bincount(ids, minlength=count)
    mean = np.bincount(ids, wanted.ravel(), count) / np.maximum(pixels, 1)
    alone = np.bincount(objects.corner[objects.corner[..., 0] >= 0].ravel(), minlength=count) == pixels
    rim = rim[alone[rim]]
    nearest_behind = _behind(mesh, inverse, camera)
    new = np.clip(mean[rim], nearest_behind[rim] * (1 + 2 * BEHIND), None)
    new = np.minimum(new, inverse[rim])
    vertices = mesh.vertices.copy()
    vertices[rim] = mesh.vertices[rim] * (inverse[rim] / new)[:, None]
    return replace(mesh, vertices=vertices)


def _tangent(inside: Array, thickness: Array, depth: Array, normal: Array, camera: Camera) -> Array:
    """[N, 4] inverse depth of the tangent planes of the pixels inside [H, W] at their corners."""
    near = depth[inside].astype(np.float64)[:, None]  # [N, 1]
    rays = pixel_rays(camera).astype(np.float64)[inside]  # [N, 3]
    corners = np.repeat(rays[:, None], 4, 1)  # [N, 4, 3]
    corners[..., :2] += _OFFSETS * np.array([1, -1]) / camera.focal
    facing = (normal[inside] * rays).sum(-1)[:, None]  # < 0 where the surface is seen
    there = (normal[inside][:, None] * corners).sum(-1)
    # On a plane inverse depth goes as n . r; towards the silhouette that falls to 0.
    share = np.where(facing < -1e-6, there / np.minimum(facing, -1e-6), 0)
    middle = near / (near + thickness[inside][:, None] / (2 * np.linalg.norm(rays, axis=-1, keepdims=True)))
    return np.maximum(share, middle) / near


def _behind(mesh: Mesh, inverse: Array, camera: Camera) -> Array:
    """[V] inverse depth of the nearest vertex that lies behind each one at the same corner of the pixel grid; or 0."""
    screen = mesh.vertices[:, :2] * inverse[:, None] * camera.focal  # [V, 2] from the middle of the picture
    column, row = np.round(screen[:, 0] + camera.width / 2), np.round(camera.height / 2 - screen[:, 1])
    place = (row * (camera.width + 1) + column).astype(np.int64)
    order = np.lexsort((inverse, place))  # the farthest first
    last, here = order[:-1], order[1:]
    found = np.zeros(len(inverse))
    found[here] = np.where(place[last] == place[here], inverse[last], 0)
    return found
