"""Closed surfaces of triangles, made of two sheets over one region of the picture and the wall between them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from trimesh import Trimesh
from trimesh.intersections import slice_faces_plane

from materialist.camera import rays_through, unit
from materialist.geometry.boundary import grid_faces, joined_faces
from materialist.types import Array, Camera, Triangles


@dataclass(frozen=True, eq=False)
class Shell(Triangles):
    """A closed surface; uv is the place in the picture, in [0, 1]."""

    hollow: bool = False
    """Whether one of its parts bounds a cavity."""


def joined_shells(shells: Sequence[Shell]) -> Shell:
    """Several surfaces as one; none of them shares a vertex with another."""
    vertices, faces = joined_faces(shells)
    normals = np.concatenate([shell.normals for shell in shells])
    uv = np.concatenate([shell.uv for shell in shells])
    return Shell(vertices, faces, normals, uv, any(shell.hollow for shell in shells))


def inside_out(shell: Shell) -> Shell:
    """The surface inside out: that of a cavity."""
    return Shell(
        shell.vertices, np.ascontiguousarray(shell.faces[:, ::-1]), -shell.normals, shell.uv, True
    )


def region(field: Array) -> tuple[Array, Array]:
    """The region where `field` [H, W] > 0, as points [V, 2] (x, y) and faces [F, 3]; linear between the grid points.

    Faces are counter-clockwise seen with y up. No value of the field is 0. Values beyond the grid count as negative at
    once: a caller who wants a smooth end there leaves a margin.
    """
    y, x = np.indices(field.shape)
    grid = np.stack([x, y, field], -1).reshape(-1, 3)
    # Both triangles of a cut side have points of their own there, which Trimesh merges.
    above = Trimesh(*slice_faces_plane(grid, grid_faces(*field.shape), [0, 0, 1], [0, 0, 0])[:2])
    return np.asarray(above.vertices[:, :2]), np.asarray(above.faces)


def closed_shell(
    region: Array,
    place: Array,
    front: Array,
    thick: Array,
    normals: tuple[Array, Array],
    outward: Array,
    camera: Camera,
) -> Shell:
    """The closed surface over the faces [F, 3] of a region, between a front and a back over its vertices.

    Its wall has vertices of its own, which look across the rays: it is a silhouette.

    place: [V, 2] (x, y) pixels of the picture, 0 at the centre of the first one. front: [V] planar depth, scene units.
    thick: [V] to the back along the ray, scene units > 0. normals: of front and back, [V, 3] unit, outwards.
    outward: [V, 2] direction (y down) in the picture in which the region ends, on its border.
    """
    count = len(place)
    # --- The border: edges that no second face runs through the other way ---
    edges = np.concatenate([region[:, [0, 1]], region[:, [1, 2]], region[:, [2, 0]]])
    border = edges[~np.isin(edges[:, 0] * count + edges[:, 1], edges[:, 1] * count + edges[:, 0])]
    rim = np.unique(border)

    # --- Vertices: front, back, and the two rims of the wall ---
    index = np.concatenate(
        [np.arange(count), np.arange(count), rim, rim]
    )  # front, back, the wall's two sides
    beyond = np.concatenate([np.zeros(count), thick, np.zeros(len(rim)), thick[rim]])
    screen = place[index] + 0.5
    rays = rays_through(screen, camera)
    vertices = rays * (front[index] + beyond / np.linalg.norm(rays, axis=-1))[:, None]
    uv = np.clip(screen / [camera.width, camera.height], 0, 1).astype(np.float32)

    # --- Faces: the region, the region reversed, and two triangles of wall for each border edge ---
    a, b = 2 * count + np.searchsorted(rim, border).T
    wall = [np.stack([b, a, a + len(rim)], -1), np.stack([b, a + len(rim), b + len(rim)], -1)]
    faces = np.concatenate([region, region[:, ::-1] + count, *wall])
    side = _across(vertices[rim], outward[rim])
    every = np.concatenate([*normals, side, side])
    return Shell(vertices.astype(np.float32), faces.astype(np.int32), every.astype(np.float32), uv)


def _across(points: Array, outward: Array) -> Array:
    """[R, 3] unit normals of a wall along the rays to points [R, 3], that ends the region towards `outward` [R, 2]."""
    ray = unit(points)
    # The picture's y runs down, the camera's up.
    side = np.stack([outward[:, 0], -outward[:, 1], np.zeros(len(outward))], -1)
    return unit(side - (side * ray).sum(-1, keepdims=True) * ray)
