"""Closed surfaces of triangles, made of two sheets over one region of the picture and the wall between them."""

from typing import NamedTuple

import numpy as np

from materialist.camera import rays_through, unit
from materialist.types import Array, Camera

CLEAR = 0.04
"""Part of a cell's side that a crossing keeps from its corners: no two points in one place."""
# Slots of a cell: corners 0 to 3 clockwise from the top left (y down), then the crossings of its top, right, bottom
# and left side, 4 to 7. Triangles turn as top left, bottom left, bottom right do: counter-clockwise with y up.
_POLYGONS: dict[int, tuple[tuple[int, ...], ...]] = {
    1: ((0, 7, 4),), 2: ((1, 4, 5),), 4: ((2, 5, 6),), 8: ((3, 6, 7),),
    3: ((0, 7, 5, 1),), 6: ((1, 4, 6, 2),), 12: ((2, 5, 7, 3),), 9: ((3, 6, 4, 0),),
    5: ((0, 7, 4), (2, 5, 6)), 10: ((1, 4, 5), (3, 6, 7)),
    7: ((1, 0, 7, 6, 2),), 14: ((2, 1, 4, 7, 3),), 13: ((3, 2, 5, 4, 0),), 11: ((0, 3, 6, 5, 1),),
    15: ((0, 3, 2, 1),),
}  # fmt: skip
"""Corner pattern (bit k: corner k is inside) -> polygons; corners across a diagonal stay apart."""


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
    hollow: bool = False
    """Whether one of its parts bounds a cavity."""


def joined(shells: list[Shell]) -> Shell:
    """Several surfaces as one; none of them shares a vertex with another."""
    first = np.cumsum([0] + [len(shell.vertices) for shell in shells])
    faces = np.concatenate([shell.faces + start for shell, start in zip(shells, first)]).astype(np.int32)
    vertices, normals, uv = (np.concatenate([getattr(s, n) for s in shells]) for n in ("vertices", "normals", "uv"))
    return Shell(vertices, faces, normals, uv, any(shell.hollow for shell in shells))


def inside_out(shell: Shell) -> Shell:
    """The surface inside out: that of a cavity."""
    return Shell(shell.vertices, np.ascontiguousarray(shell.faces[:, ::-1]), -shell.normals, shell.uv, True)


class MeshedRegion(NamedTuple):
    """A triangulated part of the plane."""

    points: Array
    """[V, 2] float64 (x, y), y down."""
    faces: Array
    """[F, 3] int64, counter-clockwise seen with y up."""
    border: Array
    """[B, 2] int64 edges with one face only, in that face's direction; every vertex on one has one in and one out."""


def region(field: Array) -> MeshedRegion:
    """The region where `field` [H, W] > 0, interpolated linearly between the grid points (x, y) = (column, row).

    Values beyond the grid count as negative at once: a caller who wants a smooth end there leaves a margin.
    """
    height, width = field.shape
    inside = field > 0
    points = np.argwhere(inside)[:, ::-1].astype(np.float64)
    corner = np.full((height, width), -1, np.int64)
    corner[inside] = np.arange(len(points))
    across, found_x = _crossings(field, inside, len(points))
    down, found_y = _crossings(field.T, inside.T, len(points) + len(found_x))
    points = np.concatenate([points, found_x, found_y[:, ::-1]])
    down = down.T  # [H-1, W] vertex on the side between (i, j) and (i+1, j)
    slots = np.stack(
        [corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1],
         across[:-1], down[:, 1:], across[1:], down[:, :-1]], -1,
    )  # fmt: skip
    kind = inside[:-1, :-1] + 2 * inside[:-1, 1:] + 4 * inside[1:, 1:] + 8 * inside[1:, :-1]
    faces = []
    for pattern, polygons in _POLYGONS.items():
        cells = slots[kind == pattern]
        for polygon in polygons:
            fan = [(polygon[0], polygon[k], polygon[k + 1]) for k in range(1, len(polygon) - 1)]
            faces.append(cells[:, np.array(fan)].reshape(-1, 3))
    joined = np.concatenate(faces)
    edges = np.concatenate([joined[:, [0, 1]], joined[:, [1, 2]], joined[:, [2, 0]]])
    lone = ~np.isin(edges[:, 0] * len(points) + edges[:, 1], edges[:, 1] * len(points) + edges[:, 0])
    return MeshedRegion(points, joined, edges[lone])


def _crossings(field: Array, inside: Array, first: int) -> tuple[Array, Array]:
    """Vertices on horizontal sides: their numbers [H, W-1] from `first` on, -1 for none, and (x, y) [n, 2]."""
    crossed = inside[:, :-1] != inside[:, 1:]
    number = np.full(crossed.shape, -1, np.int64)
    number[crossed] = first + np.arange(crossed.sum())
    rows, columns = np.nonzero(crossed)
    left, right = field[rows, columns], field[rows, columns + 1]
    part = np.clip(left / (left - right), CLEAR, 1 - CLEAR)
    return number, np.stack([columns + part, rows], -1).astype(np.float64)


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


def closed(region: MeshedRegion, sheets: Sheets, camera: Camera) -> Shell:
    """The closed surface; its wall has vertices of its own, which look across the rays: it is a silhouette."""
    count, rim = len(sheets.place), np.unique(region.border)
    index = np.concatenate([np.arange(count), np.arange(count), rim, rim])  # front, back, the wall's two sides
    beyond = np.concatenate([np.zeros(count), sheets.thick, np.zeros(len(rim)), sheets.thick[rim]])
    place = sheets.place[index] + 0.5
    rays = rays_through(place, camera)
    vertices = rays * (sheets.front[index] + beyond / np.linalg.norm(rays, axis=-1))[:, None]
    uv = np.clip(place / [camera.width, camera.height], 0, 1).astype(np.float32)
    a, b = 2 * count + np.searchsorted(rim, region.border).T
    wall = [np.stack([b, a, a + len(rim)], -1), np.stack([b, a + len(rim), b + len(rim)], -1)]
    faces = np.concatenate([region.faces, region.faces[:, ::-1] + count, *wall])
    side = _across(vertices[rim], sheets.outward[rim])
    normals = np.concatenate([sheets.front_normal, sheets.back_normal, side, side])
    return Shell(vertices.astype(np.float32), faces.astype(np.int32), normals.astype(np.float32), uv)


def _across(points: Array, outward: Array) -> Array:
    """[R, 3] unit normals of a wall along the rays to points [R, 3], that ends the region towards `outward` [R, 2]."""
    ray = unit(points)
    side = np.stack([outward[:, 0], -outward[:, 1], np.zeros(len(outward))], -1)
    return unit(side - (side * ray).sum(-1, keepdims=True) * ray)
