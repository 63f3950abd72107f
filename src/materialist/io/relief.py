"""A quick look at a mesh from the side: points and a depth buffer, no renderer."""

from __future__ import annotations

import numpy as np

from materialist.types import Array, Camera, Mesh

_TURN, _TILT = np.radians(24.0), np.radians(12.0)
_STEP_BACK = 1.12
"""The depth is stretched by this, so that the turned surface stays in frame."""
_PER_PIXEL = 5
"""Samples for each pixel that a face covers: few holes, and those are closed from their neighbours."""
_LIMIT = 1_500_000
_CLAY = np.array([214, 208, 198], np.float32)
_CONTINUED = np.array([92, 122, 158], np.float32)
_GROUND = (36, 38, 42)


def relief(mesh: Mesh, camera: Camera, side: int = 280) -> Array:
    """[h, w, 3] uint8: the mesh in clay, seen from 24 degrees to the right and 12 above; continued planes in blue.

    The longer side has `side` pixels. The camera turns about the median surface point and stays at its distance.
    """
    scale = side / max(camera.width, camera.height)
    width, height = max(1, round(camera.width * scale)), max(1, round(camera.height * scale))
    surface = mesh.faces[mesh.face_plane < 0]
    if not len(surface):
        return np.full((height, width, 3), _GROUND, np.uint8)
    pivot = np.median(mesh.vertices[surface].mean(1), 0)
    view = Camera(width, height, camera.fov)
    vertices = (mesh.vertices - pivot) @ _rotation().T + pivot
    face, points = _samples(vertices, mesh.faces, view)
    screen, depth = _project(points, view)
    light = np.clip(mesh.normals @ _rotation().T @ np.array([-0.35, 0.5, 0.79], np.float32), 0, 1)  # [V]
    shade = 0.25 + 0.75 * light[mesh.faces[face, 0]]
    colour = np.where(mesh.face_plane[face][:, None] < 0, _CLAY, _CONTINUED) * shade[:, None]
    inside = (depth > 0) & (screen >= 0).all(-1) & (screen < (width, height)).all(-1)
    index = screen[inside].astype(np.int64) @ np.array([1, width])
    order = np.argsort(-depth[inside], kind="stable")  # nearest last, so that it stays
    picture = np.full((height * width, 3), -1, np.float32)
    picture[index[order]] = colour[inside][order]
    return _closed(picture.reshape(height, width, 3)).astype(np.uint8)


def _samples(vertices: Array, faces: Array, view: Camera) -> tuple[Array, Array]:
    """Faces [N] and points [N, 3] on them, as dense as the pixels they cover; the same ones every time."""
    screen, depth = _project(vertices, view)
    corners, ahead = screen[faces], (depth[faces] > 0).all(-1)  # [F, 3, 2], [F]
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    # Faces turned away are not drawn, so that the back of an object does not shine through between the front's samples.
    area = 0.5 * np.maximum(first[:, 1] * second[:, 0] - first[:, 0] * second[:, 1], 0)
    low = np.clip(corners.min(1), 0, (view.width, view.height))
    high = np.clip(corners.max(1), 0, (view.width, view.height))
    # A face that reaches far out of the picture is worth the samples of its whole area, up to a bound.
    area = np.where((high - low).min(-1) > 0, np.minimum(area, 8 * view.width * view.height), 0)
    area = np.where(ahead, area, 0)
    count = np.ceil(area * _PER_PIXEL)
    count = np.ceil(count * min(1.0, _LIMIT / max(float(count.sum()), 1.0))).astype(np.int64)
    face = np.repeat(np.arange(len(faces)), count)
    u, v = np.random.default_rng(0).random((2, len(face)), np.float32)
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    # Even on the screen, not on the surface: weights are divided by depth and normalised.
    weight = np.stack([1 - u - v, u, v], -1) / depth[faces[face]]
    weight /= weight.sum(-1, keepdims=True)
    return face, np.einsum("nk,nkc->nc", weight, vertices[faces[face]])


def _project(points: Array, view: Camera) -> tuple[Array, Array]:
    """Screen position [N, 2] and stretched depth [N] of turned points."""
    depth = -points[..., 2] * _STEP_BACK
    safe = np.where(depth > 1e-6, depth, 1.0)
    x = points[..., 0] / safe * view.focal + view.width / 2
    y = -points[..., 1] / safe * view.focal + view.height / 2
    return np.stack([x, y], -1), np.where(depth > 1e-6, depth, 0)


def _closed(picture: Array) -> Array:
    """Fill single empty pixels (negative) from at least five full neighbours; the rest becomes the ground."""
    import cv2

    full = (picture[..., 0] >= 0).astype(np.float32)
    weight = cv2.boxFilter(full, -1, (3, 3), normalize=False, borderType=cv2.BORDER_REPLICATE)
    total = cv2.boxFilter(picture * full[..., None], -1, (3, 3), normalize=False, borderType=cv2.BORDER_REPLICATE)
    mean = total / np.maximum(weight, 1)[..., None]
    ground = np.array(_GROUND, np.float32)
    return np.where(full[..., None] > 0, picture, np.where(weight[..., None] >= 5, mean, ground))


def _rotation() -> Array:
    """[3, 3] turn about +Y, then tilt about +X."""
    c, s = np.cos(_TURN), np.sin(_TURN)
    ct, st = np.cos(_TILT), np.sin(_TILT)
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    tilt = np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]])
    return (tilt @ turn).astype(np.float32)
