"""Shading normals of meshes that come without: smooth, but for edges where faces meet at a sharp angle."""

import numpy as np
from scipy import sparse

from materialist.camera import unit
from materialist.types import Array
from materialist_lab.procedural.objects.shapes import face_normals


def creased(vertices: Array, faces: Array, angle: float) -> tuple[Array, Array, Array]:
    """(source [N], faces [F, 3], normals [N, 3]): vertex n is a copy of vertex source[n] with a normal of its own.

    angle: radians; faces around a place that meet at less share a normal, whichever way round they are.
    """
    flat = face_normals(vertices, faces)
    direction = unit(flat)
    scale = max(float(np.ptp(vertices, axis=0).max()), 1e-12)
    keys = np.round(vertices / scale * 1e5).astype(np.int64) @ np.array([1, 2**21, 2**42])
    _, place = np.unique(keys, return_inverse=True)
    corner_place = place[faces].ravel()
    corner_face = np.repeat(np.arange(len(faces)), 3)
    count = len(corner_face)
    at = sparse.csr_matrix((np.ones(count, np.int8), (np.arange(count), corner_place)))
    pairs = (at @ at.T).tocoo()
    first_face = corner_face[pairs.row]
    other = corner_face[pairs.col]
    cosine = np.einsum("pc,pc->p", direction[first_face], direction[other])
    weight = np.sign(cosine) * (np.abs(cosine) > np.cos(angle))
    total = [np.bincount(pairs.row, weight * flat[other, k], count) for k in range(3)]
    normals = unit(np.stack(total, -1))
    # Corners of one vertex with one normal become one vertex again.
    rounded = np.rint(normals * 511).astype(np.int64) @ np.array([1, 2**10, 2**20]) + 2**31
    _, first, group = np.unique(
        faces.ravel().astype(np.int64) * 2**33 + rounded, return_index=True, return_inverse=True
    )
    return faces.ravel()[first], group.reshape(-1, 3).astype(np.int32), normals[first]
