"""Closed surfaces of triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from materialist.types import Array


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


def turned(shell: Shell) -> Shell:
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
