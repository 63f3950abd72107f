"""Creases: pixels whose normals differ much share the points of the mesh, but not its normals.

A normal that is the mean of a wall's and of the floor's below it belongs to neither, and lights the last row of the
wall from above: a bright line along every crease, and around the foot of everything that stands on something.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.geometry.boundary import QUAD, face_camera
from materialist.geometry.objects import pixel_corners
from materialist.types import Array, Mesh

CREASE = 40.0
"""Angle between the normals of two pixels, degrees, from which neither has a part in the other's shading."""


def split_creases(mesh: Mesh, depth: Array, normal: Array, *, crease: float = CREASE) -> Mesh:
    """The mesh with a vertex for each normal where pixels of different normals meet; its points stay where they are.

    The corner of a pixel gets the mean normal of those pixels that have the vertex in common and whose normals are
    within `crease` degrees of the pixel's own. Faces keep their order, everything but the visible pixels its normals.

    mesh: whose first faces are two for each pixel with a surface, as of `depth_to_mesh`. depth: [H, W], 0 = none.
    normal: [H, W, 3] unit, camera frame.
    """
    own = normal[depth > 0].astype(np.float64)  # [P, 3]
    vertex = pixel_corners(mesh, depth > 0)[depth > 0].ravel()  # [4 P]
    order = np.argsort(vertex, kind="stable")
    sorted_vertex = vertex[order]
    starts = np.flatnonzero(np.diff(sorted_vertex, prepend=-1))
    place = np.empty_like(order)  # [4 P] which of its vertex's up to four pixels each one is
    place[order] = np.arange(len(order)) - np.repeat(starts, np.diff(starts, append=len(order)))
    around = np.full((len(mesh.vertices), 4), -1)
    around[vertex, place] = np.repeat(np.arange(len(own)), 4)  # [V, 4] pixels that meet in a vertex
    near = around[vertex]  # [4 P, 4]
    alike = (near >= 0) & ((own[near] * np.repeat(own, 4, 0)[:, None]).sum(-1) > np.cos(np.radians(crease)))
    alike[np.arange(len(vertex)), place] = True
    # Pixels with the same company share a vertex.
    key, first, number = np.unique(vertex * 16 + alike @ [1, 2, 4, 8], return_index=True, return_inverse=True)
    shading = np.where(alike[first][..., None], own[near[first]], 0).sum(1)  # [K, 3]
    rest = len(mesh.vertices)  # the vertices there were, for everything else
    quads = rest + number.reshape(-1, 4)[:, QUAD].reshape(-1, 3)
    points = mesh.vertices[key // 16]
    return _tidy(replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, points]),
        normals=np.concatenate([mesh.normals, face_camera(shading, points)]),
        uv=np.concatenate([mesh.uv, mesh.uv[key // 16]]),
        faces=np.concatenate([quads, mesh.faces[2 * len(own) :]]).astype(np.int32),
    ))  # fmt: skip


def _tidy(mesh: Mesh) -> Mesh:
    """The mesh without vertices that no face has."""
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.faces] = True
    number = np.cumsum(used) - 1
    kept = {name: getattr(mesh, name)[used] for name in ("vertices", "normals", "uv")}
    return replace(mesh, faces=number[mesh.faces].astype(np.int32), **kept)
