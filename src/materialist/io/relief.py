"""A quick look at a mesh from the side: points and a depth buffer, no renderer."""

from __future__ import annotations

import numpy as np

from materialist.types import Array, Camera, Mesh

_TURN, _TILT = np.radians(24.0), np.radians(12.0)
_CLAY = np.array([214, 208, 198], np.float32)
_CONTINUED = np.array([104, 134, 168], np.float32)
_GROUND = (36, 38, 42)


def relief(mesh: Mesh, camera: Camera, side: int = 280) -> Array:
    """[h, w, 3] uint8: the mesh in clay, seen from 24 degrees to the right and 12 above; continued planes in blue.

    The longer side has `side` pixels. The camera turns about the median surface point and stays at its distance.
    """
    scale = side / max(camera.width, camera.height)
    width, height = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    picture = np.full((height, width, 3), _GROUND, np.uint8)
    surface = mesh.faces[mesh.face_plane < 0]
    if not len(surface):
        return picture
    points, normals, plane = _samples(mesh)
    pivot = np.median(mesh.vertices[surface[:, 0]], 0)
    turned = (points - pivot) @ _rotation().T + pivot
    shade = 0.25 + 0.75 * np.clip(normals @ _rotation().T @ np.array([-0.35, 0.5, 0.79], np.float32), 0, 1)
    colour = np.where(plane[:, None] < 0, _CLAY, _CONTINUED) * shade[:, None]
    depth = -turned[:, 2] * 1.12  # a step back, so that the turned surface stays in frame
    focal = 0.5 * width / np.tan(np.radians(camera.fov) / 2)
    ahead = depth > 1e-6
    column = np.floor(turned[:, 0] / np.where(ahead, depth, 1) * focal + width / 2)
    row = np.floor(-turned[:, 1] / np.where(ahead, depth, 1) * focal + height / 2)
    inside = ahead & (column >= 0) & (column < width) & (row >= 0) & (row < height)
    index = (row[inside] * width + column[inside]).astype(np.int64)
    order = np.argsort(-depth[inside], kind="stable")  # nearest last, so that it stays
    picture.reshape(-1, 3)[index[order]] = colour[inside][order].astype(np.uint8)
    return picture


def _samples(mesh: Mesh, limit: int = 400_000) -> tuple[Array, Array, Array]:
    """Points, normals and planes spread over the faces by area, at most about `limit`; the same ones every time."""
    corners = mesh.vertices[mesh.faces]  # [F, 3, 3]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    # A far face covers fewer pixels: what counts is its area over its distance squared.
    area = area / np.maximum((corners.mean(1) ** 2).sum(-1), 1e-12)
    count = np.ceil(area / max(area.sum(), 1e-30) * limit / 2).astype(np.int64)
    face = np.repeat(np.arange(len(mesh.faces)), np.minimum(count, limit // 4))
    rng = np.random.default_rng(0)
    u, v = rng.random((2, len(face)), np.float32)
    over = u + v > 1
    u, v = np.where(over, 1 - u, u), np.where(over, 1 - v, v)
    weight = np.stack([1 - u - v, u, v], -1)[..., None]  # [N, 3, 1]
    points = (corners[face] * weight).sum(1)
    return points, mesh.normals[mesh.faces[face, 0]], mesh.face_plane[face]


def _rotation() -> Array:
    """[3, 3] turn about +Y, then tilt about +X."""
    c, s = np.cos(_TURN), np.sin(_TURN)
    ct, st = np.cos(_TILT), np.sin(_TILT)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    tilt = np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]])
    return (tilt @ turn).astype(np.float32)
