"""Backs of objects: a sheet behind what the picture shows of them, joined to it along their outline.

The sheet lies behind the visible front on every ray of the camera, so the picture does not change; light from beside
and behind, and reflections, meet an object instead of an open shell.
"""

from __future__ import annotations

import numpy as np

from materialist.geometry.boundary import BOTTOM_LEFT, BOTTOM_RIGHT, QUAD, TOP_LEFT, TOP_RIGHT
from materialist.geometry.completion import join
from materialist.geometry.objects import Objects
from materialist.geometry.planes import Plane
from materialist.solids.shell import vertex_normals
from materialist.types import Array, Mesh

CLEAR = 0.002
"""A back stays before a plane behind it by this fraction of its depth."""
FARTHEST = 4.0
"""No back is farther than this many times its front."""
BLOCK = 8
"""Pixels along the side of a patch of the sheet that eight triangles or a few more serve for; even."""


def backs_of(mesh: Mesh, objects: Objects, thickness: Array, depth: Array, planes: list[Plane]) -> Mesh:
    """The backs of the objects of a mesh, as a mesh of their own.

    mesh: from `depth_to_mesh`, whose faces come first; `objects` belong to it. thickness: [H, W] length of the camera
    ray in each object, scene units. depth: [H, W] planar scene units. planes: those that bound the scene; no back
    passes through one that stands behind it.

    The faces have face_plane -1, and the uv and face_pixel of the visible pixels before them; seen from the camera
    they turn clockwise. Where an outline is free, back and front have their vertices at the same places; along the
    rest of it walls join them.
    """
    # An object's own copies of the vertices that it shares with its neighbours.
    own, keys = _own_corners(objects, len(mesh.vertices))
    front = mesh.vertices[keys % len(mesh.vertices)].astype(np.float64)  # [K, 3]
    uv = mesh.uv[keys % len(mesh.vertices)]
    owner = objects.label.ravel()[objects.pixel].astype(np.int64)
    edges = np.searchsorted(keys, owner[:, None] * len(mesh.vertices) + objects.border)  # [E, 2]
    back = _back_points(front, own, thickness, depth, planes, edges[objects.free].ravel())
    moved = (back != front).any(-1)  # [K]
    faces, pixel = _sheet(own, objects, front, back)
    # A face whose corners all lie on the free outline would cover the front.
    solid = moved[faces].any(1)
    wall = moved[edges].any(1)
    return join([
        _part(back, faces[solid], uv, pixel[solid]),
        _walls(front, back, edges[wall], objects.pixel[wall], objects.label.shape),
    ])  # fmt: skip


def _own_corners(objects: Objects, count: int) -> tuple[Array, Array]:
    """[H, W, 4] numbers 0 .. K - 1 of the corners of objects' pixels, -1 elsewhere, and [K] object * count + vertex."""
    inside = objects.label >= 0
    keys, number = np.unique(
        objects.label[inside][:, None].astype(np.int64) * count + objects.corner[inside], return_inverse=True
    )
    own = np.full((*inside.shape, 4), -1, np.int64)
    own[inside] = number.reshape(-1, 4)
    return own, keys


def _back_points(front: Array, own: Array, thickness: Array, depth: Array, planes: list[Plane], free: Array) -> Array:
    """[K, 3] back vertices on the camera rays through the front vertices [K, 3]; the same where the outline is free."""
    inside = own[..., 0] >= 0
    corner, near = own[inside], depth[inside].astype(np.float64)  # [N, 4], [N]
    inverse = -1 / front[:, 2]  # [K]
    rays = front * inverse[:, None]  # [K, 3], z = -1
    length = np.linalg.norm(rays[corner].mean(1), axis=-1)  # [N]
    far = np.minimum(near + thickness[inside] / length, FARTHEST * near)
    gap = 1 / near - 1 / far  # [N] in inverse depth, which is linear on a triangle
    total = np.bincount(corner.ravel(), np.repeat(gap, 4), len(front))
    gap_here = total / np.bincount(corner.ravel(), minlength=len(front))
    gap_here[free] = 0
    behind = inverse - gap_here
    for plane in planes:
        limit = plane.inverse_depth(rays) * (1 + CLEAR)
        # A front that is itself beyond the plane, by an error of the depth, is left alone.
        behind = np.maximum(behind, np.where(limit > 0, np.minimum(limit, inverse), 0))
    moved = behind < inverse * (1 - 1e-6)
    return np.where(moved[:, None], rays / np.where(moved, behind, inverse)[:, None], front)


def _sheet(own: Array, objects: Objects, front: Array, back: Array) -> tuple[Array, Array]:
    """Faces [F, 3] of the backs and their pixels [F]: two a pixel, or a fan for a block of pixels where it fits."""
    width = own.shape[1]
    grid = _block_corners(own, _deep(objects))  # [h, w, BLOCK + 1, BLOCK + 1]
    whole = grid[..., 0, 0] >= 0
    # The whole of such a back lies behind the whole of its front.
    whole &= (-1 / back[grid, 2]).max((2, 3)) < (-1 / front[grid, 2]).min((2, 3))
    covered = np.zeros(own.shape[:2], bool)
    rows, columns = (BLOCK * n for n in whole.shape)
    covered[:rows, :columns] = whole.repeat(BLOCK, 0).repeat(BLOCK, 1)
    pixels = np.flatnonzero((objects.label >= 0) & ~covered)
    fine = own.reshape(-1, 4)[pixels][:, QUAD[:, ::-1]].reshape(-1, 3)
    fans, block = _fans(grid, whole)
    row, column = np.divmod(block, whole.shape[1])
    middle = (BLOCK * row + BLOCK // 2) * width + BLOCK * column + BLOCK // 2
    return np.concatenate([fine, fans]), np.concatenate([np.repeat(pixels, 2), middle])


def _deep(objects: Objects) -> Array:
    """[H, W] bool: pixels of an object that no edge of its outline touches."""
    deep = objects.label >= 0
    deep.ravel()[objects.pixel] = False
    return deep


def _block_corners(own: Array, deep: Array) -> Array:
    """[h, w, BLOCK + 1, BLOCK + 1] numbers of the grid corners in each block of the picture; -1 if not all is deep."""
    rows, columns = (n // BLOCK for n in deep.shape)
    split = lambda v: v[: rows * BLOCK, : columns * BLOCK].reshape(rows, BLOCK, columns, BLOCK).swapaxes(1, 2)  # noqa: E731
    grid = np.empty((rows, columns, BLOCK + 1, BLOCK + 1), np.int64)
    for slot, at in (
        (TOP_LEFT, np.s_[:, :, :-1, :-1]), (TOP_RIGHT, np.s_[:, :, :-1, 1:]),
        (BOTTOM_LEFT, np.s_[:, :, 1:, :-1]), (BOTTOM_RIGHT, np.s_[:, :, 1:, 1:]),
    ):  # fmt: skip
        grid[at] = split(own[..., slot])
    return np.where(split(deep).all((2, 3))[..., None, None], grid, -1)


def _fans(grid: Array, whole: Array) -> tuple[Array, Array]:
    """Faces [F, 3] from the middle of each whole block to its sides, and their block [F] (row-major).

    A side towards another whole block is one edge; towards single pixels it has all of their corners.
    """
    framed = np.pad(whole, 1)
    faces, blocks = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    # Sides in the order that runs clockwise as seen from the camera, which is counter-clockwise from behind.
    sides = (
        (framed[:-2, 1:-1], grid[:, :, 0, :]), (framed[1:-1, 2:], grid[:, :, :, -1]),
        (framed[2:, 1:-1], grid[:, :, -1, ::-1]), (framed[1:-1, :-2], grid[:, :, ::-1, 0]),
    )  # fmt: skip
    for beside, line in sides:
        for chosen, points in ((whole & beside, line[..., [0, -1]]), (whole & ~beside, line)):
            one, two = points[chosen][:, :-1], points[chosen][:, 1:]  # [B, n]
            middle = np.broadcast_to(grid[chosen][:, BLOCK // 2, BLOCK // 2, None], one.shape)
            faces.append(np.stack([middle, one, two], -1).reshape(-1, 3))
            blocks.append(np.repeat(np.flatnonzero(chosen), one.shape[1]))
    return np.concatenate(faces), np.concatenate(blocks)


def _walls(front: Array, back: Array, edges: Array, pixel: Array, shape: tuple[int, ...]) -> Mesh:
    """What closes the object where its outline is not free: quads from front to back along edges [E, 2].

    They are seen edge on; their vertices are their own, with the uv of the middle of their pixel [E].
    """
    height, width = shape
    a, b = edges.T
    vertices = np.stack([front[a], back[a], back[b], front[b]], 1).reshape(-1, 3)
    faces = (4 * np.arange(len(edges))[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    area = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    uv = np.stack([(pixel % width + 0.5) / width, (pixel // width + 0.5) / height], -1)
    solid = np.linalg.norm(area, axis=-1) > 0
    return _part(vertices, faces[solid], np.repeat(uv, 4, 0), np.repeat(pixel, 2)[solid])


def _part(vertices: Array, faces: Array, uv: Array, pixel: Array) -> Mesh:
    """A Mesh of faces [F, 3], with the vertices they use and smooth normals."""
    used, faces = np.unique(faces, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int32)
    points = vertices[used].astype(np.float32)
    return Mesh(
        points, faces, vertex_normals(points, faces), uv[used].astype(np.float32), pixel.astype(np.int32),
        np.full(len(faces), -1, np.int16),
    )  # fmt: skip
