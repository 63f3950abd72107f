"""Shapes read from files: normals where there are none, and what is wrong with them."""

from __future__ import annotations

import numpy as np

from materialist.edits.core.topology import places
from materialist.types import Array

CREASE = np.cos(np.radians(40.0))
"""Faces that meet at a sharper angle than 40 degrees keep an edge between them."""
MOST_PIECES = 200
"""Pieces that look inwards for which is asked whether they lie in another; further ones stay."""
SMOOTH_FROM = 200_000
"""Faces from which normals are smooth throughout: such meshes are scans, and pairs of faces grow many."""


def creased_normals(vertices: Array, faces: Array) -> Array:
    """[F, 3, 3] unit normals of the corners of faces [F, 3] on vertices [V, 3].

    A corner has the area-weighted mean of the faces around its place whose normals are within the crease angle of its
    own face's; vertices at one place count as one.
    """
    corners = vertices[faces].astype(np.float64)  # [F, 3, 3]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = _unit(cross)
    place = places(vertices)[faces]  # [F, 3]
    if len(faces) >= SMOOTH_FROM:
        total = np.zeros((int(place.max()) + 1, 3))
        for k in range(3):
            np.add.at(total, place[:, k], cross)
        return _unit(total)[place]
    order = np.argsort(place.ravel(), kind="stable")
    sizes = np.bincount(place.ravel())
    starts = np.cumsum(sizes) - sizes
    face_of = order // 3  # faces sorted by place
    around = sizes[place.ravel()]  # how many faces meet at each corner
    corner = np.repeat(np.arange(faces.size), around)
    offset = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    other = face_of[starts[place.ravel()][corner] + offset]
    alike = (flat[corner // 3] * flat[other]).sum(-1) > CREASE
    total = np.zeros((faces.size, 3))
    np.add.at(total, corner[alike], cross[other[alike]])
    normals = _unit(total)
    empty = np.linalg.norm(total, axis=-1) == 0
    normals[empty] = np.repeat(flat, 3, 0)[empty]
    return normals.reshape(-1, 3, 3)


def inside_out(vertices: Array, faces: Array) -> Array:
    """[F] bool: the faces of a mesh (vertices [V, 3], faces [F, 3]) that look inwards, by its closed pieces.

    The largest piece looks outwards, and so does every one that lies in no other. One inside another stays: looking
    inwards it is a cavity, outwards a thing of its own.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    place = places(vertices)[faces]
    edges = place[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    size = int(place.max()) + 1
    links = coo_array((np.ones(len(edges), np.int32), edges.T), (size, size))
    piece = connected_components(links, directed=False)[1][place[:, 0]]  # [F]
    edges = np.sort(edges[edges[:, 0] != edges[:, 1]], 1)
    where, count = np.unique(edges, axis=0, return_counts=True)
    of_place = np.zeros(size, int)
    of_place[place] = piece[:, None]
    torn = np.unique(of_place[where[count != 2, 0]])
    closed = np.setdiff1d(piece, torn)
    if not len(closed):
        return np.zeros(len(faces), bool)
    a, b, c = (vertices[faces[:, k]].astype(np.float64) - vertices.mean(0) for k in range(3))
    sizes = np.bincount(piece, np.einsum("ij,ij->i", a, np.cross(b, c)))
    turned = sizes[closed[np.abs(sizes[closed]).argmax()]] < 0
    sizes = -sizes if turned else sizes
    found = np.isin(piece, closed) & turned
    for one in closed[sizes[closed] < 0][:MOST_PIECES]:
        point = vertices[faces[piece == one][0, 0]]
        if not any(within(point, vertices, faces[piece == other]) for other in closed if other != one):
            found[piece == one] = not turned
    return found


def within(point: Array, vertices: Array, faces: Array) -> bool:
    """Whether a point [3] lies inside a closed mesh: its winding number (van Oosterom and Strackee 1983)."""
    low, high = vertices[faces].min((0, 1)), vertices[faces].max((0, 1))
    if (point < low).any() or (point > high).any():
        return False
    a, b, c = (vertices[faces[:, k]].astype(np.float64) - point for k in range(3))
    x, y, z = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    above = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = x * y * z + (a * b).sum(1) * z + (b * c).sum(1) * x + (c * a).sum(1) * y
    return bool(abs(np.arctan2(above, below).sum()) > np.pi)


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.where(length > 1e-30, vectors / np.maximum(length, 1e-30), [0.0, 1.0, 0.0])
