"""Normals from depth."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.types import Array, Camera


def normals_from_depth(depth: Array, camera: Camera, *, radius: int = 0) -> Array:
    """Unit normals [H, W, 3] float32 (camera frame, facing the viewer) of planar depth [H, W] (scene units, 0 = none).

    On a plane q = 1 / depth = a X + b Y + c for the ray (X, Y, -1), and the normal is along (-a, -b, c): planes are
    exact. The gradient (a, b) is taken from the side of each pixel that continues its neighbours best, not across depth
    edges; `radius` > 0 averages it over (2 radius + 1)^2 pixels on the same surface, which calms noisy or quantised
    depth. Pixels without depth get (0, 0, 1).
    """
    known = depth > 0
    q = np.where(known, 1.0 / np.where(known, depth, 1), np.nan)  # [H, W] 1 / scene units, float64
    a, b = _gradient(q, axis=1), _gradient(q, axis=0)  # per pixel, to the right and down
    if radius > 0:
        a, b = _average(q, a, b, radius)
    a = a * camera.focal
    b = -b * camera.focal
    rays = pixel_rays(camera)
    c = np.where(known, q, 1) - a * rays[..., 0] - b * rays[..., 1]
    normal = np.stack([-a, -b, c], -1)
    normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-20)
    normal[~known] = (0, 0, 1)
    return normal.astype(np.float32)


def _gradient(q: Array, axis: int) -> Array:
    """Edge-aware derivative [H, W] per pixel along an axis; NaN marks holes in q, 0 where no neighbour is known.

    Each side is weighted by how well its two nearest pixels extrapolate to this one: across an edge they do not.
    """
    q = np.moveaxis(q, axis, -1)
    n = q.shape[-1]
    padded = np.pad(q, [(0, 0), (2, 2)], constant_values=np.nan)

    def at(k):
        return padded[:, 2 + k : 2 + k + n]

    total = np.zeros_like(q)
    weights = np.zeros_like(q)
    for side in (-1, 1):
        slope = (at(side) - q) * side
        error = np.abs(q - (2 * at(side) - at(2 * side))) / q
        # A side with one pixel only is judged by its own step: it is used when there is nothing better.
        error = np.where(np.isnan(error), 1e-2 + np.abs(slope) / q, error)
        weight = np.where(np.isnan(slope), 0, 1 / (error + 1e-5) ** 2)
        total += weight * np.where(np.isnan(slope), 0, slope)
        weights += weight
    return np.moveaxis(np.divide(total, weights, out=np.zeros_like(q), where=weights > 0), -1, axis)


def _average(q: Array, a: Array, b: Array, radius: int) -> tuple[Array, Array]:
    """Mean gradient over the window, each pixel weighted by how well it lies on the plane of the central one."""
    h, w = q.shape
    pad = [(radius, radius)] * 2
    q_pad, a_pad, b_pad = (np.pad(x, pad, constant_values=np.nan) for x in (q, a, b))
    sum_a = np.zeros_like(q)
    sum_b = np.zeros_like(q)
    total = np.zeros_like(q)
    for dy in range(-radius, radius + 1):
        for dx in range(-radius, radius + 1):
            rows = slice(radius + dy, radius + dy + h)
            columns = slice(radius + dx, radius + dx + w)
            a_n = a_pad[rows, columns]
            b_n = b_pad[rows, columns]
            # Middle of both pixels' predictions: an off-centre error of either gradient counts half.
            step = q_pad[rows, columns] - q - 0.5 * ((a + a_n) * dx + (b + b_n) * dy)
            weight = np.nan_to_num(np.exp(-((step / (0.01 * q)) ** 2)))
            sum_a += weight * np.nan_to_num(a_n)
            sum_b += weight * np.nan_to_num(b_n)
            total += weight
    # A window of holes has no weight: its gradient is 0.
    total = np.maximum(total, 1e-12)
    return sum_a / total, sum_b / total
