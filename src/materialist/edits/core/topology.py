"""Closed or open: the edges of a triangle mesh whose vertices may be doubled."""

from __future__ import annotations

import numpy as np

from materialist.types import Array


def edge_faults(vertices: Array, faces: Array) -> tuple[int, int]:
    """(edges with one face, edges with three or more) of a mesh of vertices [V, 3] and faces [F, 3].

    Vertices within a millionth of the mesh's size of each other count as one.
    """
    from trimesh import Trimesh

    extent = max(float(np.ptp(vertices, axis=0).max()), 1e-30)
    mesh = Trimesh(np.round((vertices - vertices.min(0)) / extent * 1e6), faces)  # merges vertices
    mesh.update_faces((np.diff(np.sort(mesh.faces, 1), axis=1) > 0).all(1))
    count = np.bincount(mesh.edges_unique_inverse)
    return int((count == 1).sum()), int((count > 2).sum())
