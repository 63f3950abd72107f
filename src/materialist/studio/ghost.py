"""Objects in the live preview: drawn by their triangles, without shadow or reflection, until the picture is traced."""

from __future__ import annotations

import numpy as np

from materialist.camera import project
from materialist.color import luminance
from materialist.types import Array, Body, Scene

_MOST = 12_000
"""Triangles that are drawn; of a finer mesh every n-th, and the gaps are closed."""
_LIGHT = np.array([0.35, 0.8, 0.5]) / np.linalg.norm([0.35, 0.8, 0.5])


def with_bodies(picture: Array, scene: Scene) -> Array:
    """[H, W, 3] linear picture with the scene's bodies drawn where they are nearer than the surface."""
    import cv2

    colour = np.zeros((*picture.shape[:2], 3), np.float32)
    depth = np.full(picture.shape[:2], np.inf, np.float32)
    exposure = 2 * float(luminance(scene.photo.linear).mean())
    clear = 1.0
    for body in scene.bodies:
        glass = float(np.mean(body.surface.transmission))
        clear = min(clear, 1 - 0.7 * glass)
        _draw(body, scene, colour, depth, exposure)
    hole = np.isinf(depth)
    depth[hole] = 0
    if any(len(body.faces) > _MOST for body in scene.bodies):
        kernel = np.ones((3, 3), np.uint8)
        colour, depth = cv2.dilate(colour, kernel), cv2.dilate(depth, kernel)
    behind = (scene.depth > 0) & (scene.depth * 1.02 < depth)
    share = np.where((depth > 0) & ~behind, clear, 0)[..., None].astype(np.float32)
    return picture * (1 - share) + colour * share


def _draw(body: Body, scene: Scene, colour: Array, depth: Array, exposure: float) -> None:
    """Paint a body into colour [H, W, 3] and depth [H, W], far triangles first."""
    import cv2

    stride = -(-len(body.faces) // _MOST)
    corners = body.vertices[body.faces[::stride]]  # [F, 3, 3]
    pixels, away = project(corners, scene.camera)
    middle = away.mean(1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    seen = (away > 0).all(1) & (length > 0) & (np.einsum("fi,fi->f", normal, corners.mean(1)) < 0)
    shade = 0.35 + 0.65 * np.clip(normal @ _LIGHT / np.maximum(length, 1e-20), 0, 1)
    albedo = np.asarray(body.surface.albedo, np.float32).reshape(-1, 3).mean(0)
    points = np.round(np.clip(pixels, -1e5, 1e5) * 16).astype(np.int32)  # sixteenths of a pixel
    for face in np.argsort(-middle):
        if seen[face]:
            tone = [float(v) for v in np.minimum(albedo * shade[face] * exposure, 1)]
            cv2.fillConvexPoly(colour, points[face], tone, shift=4)
            cv2.fillConvexPoly(depth, points[face], float(middle[face]), shift=4)
