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
    exposure = 2 * float(luminance(scene.photo.linear).mean())
    for body in sorted(scene.bodies, key=lambda body: float(body.vertices[:, 2].mean())):  # the farthest first
        colour, depth = _drawn(body, scene, exposure)
        behind = (scene.depth > 0) & (scene.depth * 1.02 < depth)
        share = 1 - 0.7 * body.surface.transmission
        picture = np.where(((depth > 0) & ~behind)[..., None], picture + share * (colour - picture), picture)
    return picture.astype(np.float32)


def with_pane(picture: Array, region: Array, tint: tuple[float, float, float]) -> Array:
    """[H, W, 3] with the object under a region [H, W] bool as a see-through shape, until its glass is traced.

    Its surroundings carried on into it, smooth, with a rim and a little of the object's own form.
    """
    import cv2

    if not region.any():
        return picture
    height, width = region.shape
    spread = max(2.0, 0.25 * float(np.sqrt(region.sum())))  # pixels
    step = max(1, int(spread / 4))  # blurred at a size at which it is blurred by a few pixels
    size = (-(-width // step), -(-height // step))
    small = lambda v: cv2.resize(np.ascontiguousarray(v), size, interpolation=cv2.INTER_AREA)  # noqa: E731
    blur = lambda v: cv2.GaussianBlur(v, (0, 0), spread / step, borderType=cv2.BORDER_REPLICATE)  # noqa: E731
    outside = (~region).astype(np.float32)
    share = np.maximum(blur(small(outside)), 1e-3)[..., None]
    around = cv2.resize(blur(small(picture * outside[..., None])) / share, (width, height))[region]  # [N, 3]
    depth = cv2.distanceTransform(region.astype(np.uint8), cv2.DIST_L2, 3)  # [H, W] pixels to the border
    rim = np.exp(-depth[region] / max(1.5, 0.12 * float(depth.max())))[:, None]
    form = luminance(picture[region])[:, None]
    inside = (0.8 * around + 0.2 * form) * np.asarray(tint, np.float32) * (1 - 0.4 * rim) + 0.12 * rim * around.max()
    out = picture.copy()
    out[region] = inside
    return out


def glazed(picture: Array, box: tuple[int, int, int, int], piece: Array, share: Array) -> Array:
    """[H, W, 3] with a piece [h, w, 3] laid over the rows and columns of a box, by its share [h, w]."""
    top, bottom, left, right = box
    out = picture.copy()
    under = out[top:bottom, left:right]
    out[top:bottom, left:right] = under + share[..., None] * (piece - under)
    return out


def _drawn(body: Body, scene: Scene, exposure: float) -> tuple[Array, Array]:
    """Colour [H, W, 3] and depth [H, W] (0: nothing) of a body, far triangles drawn first."""
    import cv2

    colour = np.zeros((*scene.depth.shape, 3), np.float32)
    depth = np.zeros(scene.depth.shape, np.float32)
    stride = -(-len(body.faces) // _MOST)
    corners = body.vertices[body.faces[::stride]]  # [F, 3, 3]
    pixels, away = project(corners, scene.camera)
    middle = away.mean(1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    seen = (away > 0).all(1) & (length > 0) & (np.einsum("fi,fi->f", normal, corners.mean(1)) < 0)
    shade = 0.35 + 0.65 * np.clip(normal @ _LIGHT / np.maximum(length, 1e-20), 0, 1)
    albedo = np.asarray(body.surface.albedo, np.float32).reshape(-1, 3).mean(0) * np.asarray(body.surface.tint)
    points = np.round(np.clip(pixels, -1e5, 1e5) * 16).astype(np.int32)  # sixteenths of a pixel
    for face in np.argsort(-middle):
        if seen[face]:
            tone = [float(v) for v in np.minimum(albedo * shade[face] * exposure, 1)]
            cv2.fillConvexPoly(colour, points[face], tone, shift=4)
            cv2.fillConvexPoly(depth, points[face], float(middle[face]), shift=4)
    if stride > 1:
        kernel = np.ones((3, 3), np.uint8)
        return np.asarray(cv2.dilate(colour, kernel)), np.asarray(cv2.dilate(depth, kernel))
    return colour, depth
