"""Pinhole projection between pixels and the camera frame (paper, appendix "Coordinate Transformation")."""

import numpy as np

from materialist.types import Array, Camera


def pixel_rays(camera: Camera) -> Array:
    """[H, W, 3] float32 rays through pixel centres, scaled to z = -1, so that `rays * depth` is the surface point."""
    x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
    return rays_through(np.stack([x, y], -1), camera).astype(np.float32)


def rays_through(place: Array, camera: Camera) -> Array:
    """[..., 3] float64 rays through screen positions [..., 2] in pixels (x right, y down), scaled to z = -1."""
    middle = np.array([camera.width, camera.height]) / 2
    # x_s = f x / z + W / 2, inverted at z = -1; rows run downwards, +Y upwards.
    across = (np.asarray(place, np.float64) - middle) / camera.focal
    return np.stack([across[..., 0], -across[..., 1], -np.ones(across.shape[:-1])], -1)


def rays_at(rays: Array, height: int, width: int) -> Array:
    """The rays [H, W, 2] (x and y at z = -1) of a picture or of a part of one, at height x width pixels.

    Rays are linear in the pixel: beyond the first and the last pixel centre they are extrapolated.
    """
    rows, columns = rays.shape[:2]
    x = rays[0, :, 0].astype(np.float64)
    y = rays[:, 0, 1].astype(np.float64)
    # Pixel centres of the new size, as shares of the way between the first and the last old
    # centre.
    across = ((np.arange(width) + 0.5) * columns / width - 0.5) / max(columns - 1, 1)
    down = ((np.arange(height) + 0.5) * rows / height - 0.5) / max(rows - 1, 1)
    places = np.broadcast_arrays(
        x[0] + (x[-1] - x[0]) * across[None], (y[0] + (y[-1] - y[0]) * down)[:, None]
    )
    return np.stack(places, -1).astype(np.float32)


def unproject(depth: Array, camera: Camera) -> Array:
    """[H, W, 3] camera-frame points of planar depth [H, W] (scene units)."""
    return pixel_rays(camera) * depth[..., None].astype(np.float32)


def project(points: Array, camera: Camera) -> tuple[Array, Array]:
    """Screen position x_s = S(x) [..., 2] in pixels (x right, y down) and planar depth [...] of points [..., 3].

    Depth is <= 0 behind the camera; the position is then meaningless.
    """
    depth = -points[..., 2]
    # Points in the plane of the camera have no projection: any finite value will do.
    safe = np.where(np.abs(depth) < 1e-12, 1e-12, depth)
    xs = points[..., 0] / safe * camera.focal + camera.width / 2
    ys = -points[..., 1] / safe * camera.focal + camera.height / 2
    return np.stack([xs, ys], -1), depth


def turn_upright(back: Array) -> Array:
    """[3, 3] rotation whose columns are right, up and the unit direction `back` [3], with right level."""
    right = np.cross([0, 1, 0], back)
    # Looking straight up or down there is no level direction: any will do.
    right /= max(np.linalg.norm(right), 1e-9)
    return np.stack([right, np.cross(back, right), back], -1)


def unit(vectors: Array) -> Array:
    """[..., 3] or [..., 2] vectors of length 1; those of no length stay 0."""
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
