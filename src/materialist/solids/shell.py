"""Closed surfaces of triangles, and how two sheets over one region of the picture are joined to one."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from materialist.geometry.contour import Region
from materialist.types import Array, Camera


@dataclass(frozen=True)
class ShellSettings:
    """The wall between front and back."""

    collar: float = 0.35  # pixels from the last vertices of front and back to the silhouette; tuned by eye
    rings: int = 4  # rings of the wall from the front to the silhouette, and as many on the way back
    edge: float = 0.03  # part of the wall over which normals turn from front or back to the wall's; tuned by eye


DEFAULT = ShellSettings()


class Shell(NamedTuple):
    """A closed surface."""

    vertices: Array
    """[V, 3] float32, camera frame, scene units."""
    faces: Array
    """[F, 3] int32, counter-clockwise seen from outside."""
    normals: Array
    """[V, 3] float32 unit, outwards."""
    uv: Array
    """[V, 2] float32 in [0, 1]: the place in the picture, u to the right, v DOWN."""


def joined(shells: list[Shell]) -> Shell:
    """Several surfaces as one; none of them shares a vertex with another."""
    first = np.cumsum([0] + [len(shell.vertices) for shell in shells])
    faces = np.concatenate([shell.faces + start for shell, start in zip(shells, first)]).astype(np.int32)
    vertices, normals, uv = (np.concatenate([getattr(s, n) for s in shells]) for n in ("vertices", "normals", "uv"))
    return Shell(vertices, faces, normals, uv)


def inside_out(shell: Shell) -> Shell:
    """The surface inside out: that of a cavity."""
    return Shell(shell.vertices, np.ascontiguousarray(shell.faces[:, ::-1]), -shell.normals, shell.uv)


def cavities(shell: Shell) -> int:
    """How many of its separate surfaces bound a hollow: faces run clockwise, seen from outside of them."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(shell.vertices)
    a, b, c = shell.faces.T
    links = coo_matrix((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, c])), (count, count))
    number = connected_components(links, directed=False)[1]
    p, q, r = (shell.vertices[k].astype(np.float64) - shell.vertices.mean(0) for k in (a, b, c))
    volume = np.bincount(number[a], np.einsum("ij,ij->i", p, np.cross(q, r)) / 6)
    return int((volume < 0).sum())


class Sheets(NamedTuple):
    """What front and back are at the vertices of a region."""

    place: Array
    """[V, 2] (x, y) pixels of the picture, 0 at the centre of the first one."""
    front: Array
    """[V] planar depth, scene units."""
    thick: Array
    """[V] to the back along the ray, scene units > 0."""
    front_normal: Array
    """[V, 3] unit, outwards."""
    back_normal: Array
    """[V, 3] unit, outwards."""
    outward: Array
    """[V, 2] direction (y down) in the picture in which the region ends, on its border."""


def closed(region: Region, sheets: Sheets, camera: Camera) -> Shell:
    """The closed surface; its wall bulges by the collar, and looks across the rays: it is a silhouette."""
    count, place = len(sheets.place), sheets.place
    number = np.full(count, -1, np.int64)
    rim = np.unique(region.border)
    number[rim] = np.arange(len(rim))
    edges = number[region.border]  # [B, 2] in vertices of the rim
    steps = np.linspace(1, -1, 2 * DEFAULT.rings + 1)[1:-1]  # 1 at the front's last vertices, 0 at the silhouette
    turns = np.concatenate([[1 - DEFAULT.edge], steps, [DEFAULT.edge - 1]])
    wall = place[rim] + DEFAULT.collar * (1 - turns[:, None, None] ** 2) * _outward(place[rim], edges)  # [R, B, 2]
    depth_in = ((1 - turns)[:, None] * sheets.thick[rim] / 2).ravel()
    everywhere = np.concatenate([place, place, wall.reshape(-1, 2)])
    front = np.concatenate([sheets.front, sheets.front, np.tile(sheets.front[rim], len(turns))])
    vertices, uv = _in_space(everywhere, front, np.concatenate([np.zeros(count), sheets.thick, depth_in]), camera)
    # Rings in order, from the front's own vertices to the back's.
    rings = [rim, *(2 * count + k * len(rim) + np.arange(len(rim)) for k in range(len(turns))), rim + count]
    strips = [_strip(one, two, edges) for one, two in pairwise(rings)]
    faces = np.concatenate([region.faces, region.faces[:, ::-1] + count, *strips])
    side = np.tile(_across(vertices[rim], sheets.outward[rim]), (len(turns), 1))
    normals = np.concatenate([sheets.front_normal, sheets.back_normal, side])
    return Shell(vertices.astype(np.float32), faces.astype(np.int32), normals.astype(np.float32), uv)


def _across(points: Array, outward: Array) -> Array:
    """[R, 3] unit normals of a wall along the rays to points [R, 3], that ends the region towards `outward` [R, 2]."""
    ray = points / np.linalg.norm(points, axis=-1, keepdims=True)
    side = np.stack([outward[:, 0], -outward[:, 1], np.zeros(len(outward))], -1)
    side -= (side * ray).sum(-1, keepdims=True) * ray
    return side / np.maximum(np.linalg.norm(side, axis=-1, keepdims=True), 1e-9)


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


def _in_space(place: Array, front: Array, beyond: Array, camera: Camera) -> tuple[Array, Array]:
    """[N, 3] points on the rays through `place` [N, 2], `beyond` [N] along the ray behind planar depth `front` [N]."""
    column, row = place[:, 0] + 0.5, place[:, 1] + 0.5
    rays = np.stack(
        [(column - camera.width / 2) / camera.focal, (camera.height / 2 - row) / camera.focal, -np.ones(len(row))], -1
    )
    points = rays * (front + beyond / np.linalg.norm(rays, axis=-1))[:, None]
    return points, np.clip(np.stack([column / camera.width, row / camera.height], -1), 0, 1).astype(np.float32)
