"""Objects: patches of the visible surface that stand free before something, so that they must have a back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.geometry.boundary import BOTTOM_LEFT, BOTTOM_RIGHT, TOP_LEFT, TOP_RIGHT
from materialist.types import Array, Mesh

LEAST_SHARE = 4e-4
"""Objects below this share of the picture get no back: nobody sees their shadows, and they may be noise."""
LEAST_PIXELS = 12
FREE = 0.3
"""Least share of an object's outline at which it stands before something farther or before the sky. The rest of it
touches the floor, is hidden, or is cut by the frame. What lies behind its surroundings has no outline of its own."""
FRAMED = 0.4
"""Largest share of its outline that may be the picture's frame."""
CUT_OFF = 0.05
"""Largest part of the light by its normals that an object may get from below its own faces: an open one lets it in, a
closed one does not. Exact maps have up to 0.03, at rims; a smooth jug by a network 0.02, its leaves and their gaps,
which come out as one crumpled patch, 0.12 to 0.19: those stay open."""


@dataclass(frozen=True)
class Objects:
    """The objects of a picture, as pixels and as corners of the mesh."""

    label: Array
    """[H, W] int32: object of each pixel, 0, 1, ...; -1 for none."""
    corner: Array
    """[H, W, 4] int64: the mesh's front vertex at each pixel's corners (reading order), -1 without a surface."""
    border: Array
    """[E, 2] int64 front vertices of the outline's edges, counter-clockwise around their object as it is seen."""
    pixel: Array
    """[E] int64 row-major pixel of its object that each edge bounds."""
    free: Array
    """[E] bool: beyond the edge there is something farther, or the sky: the object's surface turns away here."""


def find_objects(mesh: Mesh, depth: Array, normal: Array, taken: Array) -> Objects:
    """Split what lies on no structural plane into objects.

    mesh: of the depth map, from `depth_to_mesh`. depth: [H, W] planar scene units, 0 = none. normal: [H, W, 3] unit.
    taken: [H, W] bool, the pixels of floors, walls and table tops.

    An object is a connected patch of the mesh, cut at depth boundaries, whose outline stands free (`FREE`) and whose
    faces agree with its normals (`CUT_OFF`).
    """
    corner = pixel_corners(mesh, depth > 0)
    label = _patches(corner, (depth > 0) & ~taken)
    edges, pixel, kind = _outline(corner, label, depth)
    count, owner = int(label.max(initial=-1)) + 1, label.ravel()[pixel]
    length = np.maximum(np.bincount(owner, minlength=count), 1)
    share = np.stack([np.bincount(owner[kind == k], minlength=count) / length for k in range(4)])  # [4, count]
    pixels = np.bincount(label[label >= 0], minlength=count)
    kept = pixels >= max(LEAST_PIXELS, LEAST_SHARE * label.size)
    kept &= _cut_off(mesh, corner, label, normal, count) <= CUT_OFF * pixels
    kept &= (share[_FREE] >= np.maximum(FREE, share[_HIDDEN])) & (share[_FRAME] <= FRAMED)
    number = np.append(np.where(kept, np.cumsum(kept) - 1, -1), -1)  # the last one for no object
    mine = kept[owner]
    return Objects(number[label].astype(np.int32), corner, edges[mine], pixel[mine], kind[mine] == _FREE)


def pixel_corners(mesh: Mesh, surface: Array) -> Array:
    """[H, W, 4] front vertices of each pixel's corners, read off the two faces that come first for each pixel."""
    faces = mesh.faces[: 2 * int(surface.sum())].reshape(-1, 6)
    corner = np.full((*surface.shape, 4), -1, np.int64)
    # Faces of a pixel: top left, bottom left, bottom right; top left, bottom right, top right.
    corner[surface] = faces[:, [0, 5, 1, 2]]
    return corner


def _patches(corner: Array, free: Array) -> Array:
    """[H, W] int: patches of the free pixels [H, W], connected where neighbours share an edge of the mesh."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    index = np.cumsum(free.ravel()).reshape(free.shape) - 1
    pairs = []
    for near, far, (a, b), (c, d) in _NEIGHBOURS:
        joined = free[near] & free[far] & (corner[near][..., a] == corner[far][..., c])
        joined &= corner[near][..., b] == corner[far][..., d]
        pairs.append(np.stack([index[near][joined], index[far][joined]]))
    row, column = np.concatenate(pairs, 1)
    count = int(free.sum())
    label = np.full(free.shape, -1, np.int64)
    if count:
        graph = coo_matrix((np.ones(len(row), np.int8), (row, column)), (count, count))
        label[free] = connected_components(graph, directed=False)[1]
    return label


def _cut_off(mesh: Mesh, corner: Array, label: Array, normal: Array, count: int) -> Array:
    """[count] sum over an object's pixels of the part of the light by their normals that comes from below their faces.

    Of a hemisphere weighted by the cosine to n, the part below a plane with the normal m is (1 - n . m) / 2.
    """
    inside = label >= 0
    corners = mesh.vertices[corner[inside]].astype(np.float64)  # [N, 4, 3]
    facing = np.cross(corners[:, 3] - corners[:, 0], corners[:, 1] - corners[:, 2])  # across the diagonals
    facing /= np.maximum(np.linalg.norm(facing, axis=-1, keepdims=True), 1e-30)
    lost = (1 - (facing * normal[inside]).sum(-1)) / 2
    return np.bincount(label[inside], lost, minlength=count)


_NEIGHBOURS = (
    (np.s_[:, :-1], np.s_[:, 1:], (TOP_RIGHT, BOTTOM_RIGHT), (TOP_LEFT, BOTTOM_LEFT)),
    (np.s_[:-1], np.s_[1:], (BOTTOM_LEFT, BOTTOM_RIGHT), (TOP_LEFT, TOP_RIGHT)),
)
"""Pixels and their neighbours, to the right and below, and the corners of the edge between them in either."""

_FREE, _HIDDEN, _FRAME, _TOUCHING = range(4)
"""What is beyond an edge of an outline: something farther, something nearer, nothing, the same surface."""

_SIDES = (
    (0, 1, (BOTTOM_RIGHT, TOP_RIGHT)),
    (0, -1, (TOP_LEFT, BOTTOM_LEFT)),
    (1, 0, (BOTTOM_LEFT, BOTTOM_RIGHT)),
    (-1, 0, (TOP_RIGHT, TOP_LEFT)),
)
"""Step (rows, columns) to the neighbour on each side, and the side's corners, counter-clockwise as seen."""


def _outline(corner: Array, label: Array, depth: Array) -> tuple[Array, Array, Array]:
    """Edges [E, 2] between a patch's pixel and others, that pixel [E], and what is beyond [E]."""
    height, width = label.shape
    rows, columns = np.nonzero(label >= 0)
    own = label[rows, columns]
    edges, pixel, kind = [], [], []
    for down, right, (first, last) in _SIDES:
        i, j = rows + down, columns + right
        inside = (i >= 0) & (i < height) & (j >= 0) & (j < width)
        i, j = np.clip(i, 0, height - 1), np.clip(j, 0, width - 1)
        a, b = corner[rows, columns, first], corner[rows, columns, last]
        there = corner[i, j]  # [N, 4]
        joined = inside & (there == a[:, None]).any(1) & (there == b[:, None]).any(1)
        beyond = ~(inside & (label[i, j] == own) & joined)
        farther = (depth[i, j] == 0) | (depth[i, j] > depth[rows, columns])
        found = np.select([~inside, joined, farther], [_FRAME, _TOUCHING, _FREE], _HIDDEN)
        edges.append(np.stack([a, b], -1)[beyond])
        pixel.append((rows * width + columns)[beyond])
        kind.append(found[beyond])
    return np.concatenate(edges), np.concatenate(pixel), np.concatenate(kind)
