"""Slopes of a map, its values between pixels, and the normals of a surface that is seen from within."""

import numpy as np
from scipy.ndimage import correlate, gaussian_filter, map_coordinates

from materialist.camera import unit
from materialist.geometry.membrane import nearest
from materialist.geometry.silhouette import spacing
from materialist.types import Array

SHARP = 0.5
"""Least standard deviation of the window of `depth_slopes`, pixels: hardly more than the four neighbours; by eye."""


def depth_slopes(values: Array, known: Array, sigma: float = SHARP) -> tuple[Array, Array]:
    """[H, W] change of a map [H, W] from one pixel to the next, to the right and downwards, where it is known.

    Least squares over a window with Gaussian weights of `sigma` pixels, of known [H, W] bool pixels alone: next to
    the end of the map the window is one-sided.
    """
    # --- The window, two standard deviations wide, and the plane 1, x, y to fit in it ---
    reach = int(np.ceil(2 * max(sigma, SHARP)))
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1].astype(np.float64)
    weight = np.exp(-(x**2 + y**2) / (2 * max(sigma, SHARP) ** 2))
    basis = np.ones_like(x), x, y

    def total(a, kernel):
        return correlate(a, kernel * weight, mode="constant")

    # Numbers near 1 keep the sums exact.
    mean = values[known].mean()
    spread = max(float(values[known].std()), 1e-30)
    scaled = np.where(known, (values - mean) / spread, 0)
    inside = known.astype(np.float64)
    # --- The normal equations of all windows at once ---
    moments = np.stack(
        [np.stack([total(inside, a * b) for b in basis], -1) for a in basis], -2
    )  # [H, W, 3, 3]
    # A window without a spread in some direction says that the map is level along it.
    moments = moments + np.diag([1e-9, 1e-6, 1e-6]) + np.eye(3) * ~known[..., None, None]
    solution = np.linalg.solve(moments, np.stack([total(scaled, a) for a in basis], -1)[..., None])[
        ..., 0
    ]
    return solution[..., 1] * spread, solution[..., 2] * spread


def continued(values: Array, known: Array) -> Array:
    """[H, W] float64: a map carried on along the planes of its last known pixels for 1.5 pixels, constant beyond."""
    right, down = depth_slopes(values, known)
    i, j = nearest(known)
    rows, columns = np.indices(known.shape)
    part = np.minimum(1, 1.5 / np.maximum(np.hypot(rows - i, columns - j), 1e-9))
    beyond = values[i, j] + part * (right[i, j] * (columns - j) + down[i, j] * (rows - i))
    return np.where(known, values, beyond).astype(np.float64)


def back_normals(back: Array, known: Array, rays: Array, sigma: float = SHARP) -> Array:
    """[H, W, 3] unit normals, away from the camera, of a surface that is seen from within; 0 where it is not known.

    back: [H, W] planar depth, scene units. known: [H, W] bool. sigma: of the window of `depth_slopes`, pixels.
    rays: [H, W, 3] through the pixels at z = -1, evenly spaced.
    """
    depth = np.where(known, back, 1).astype(
        np.float64
    )  # 1/z of a plane is linear: its slopes are exact
    right, down = depth_slopes(1 / depth, known, sigma)
    step = spacing(rays)
    # d log z = -z d(1/z); the tangents of z r are z (r d log z + dr).
    across = -(right * depth)[..., None] * rays + np.array([step, 0, 0])
    upright = -(down * depth)[..., None] * rays - np.array([0, step, 0])
    normal = np.cross(upright, across)
    normal *= np.sign((normal * rays).sum(-1, keepdims=True))
    return np.where(known[..., None], unit(normal), 0)


def blurred_normals(normal: Array, inside: Array, sigma: float) -> Array:
    """[H, W, 3] unit: the Gaussian mean (`sigma` pixels) of the normals inside [H, W] bool."""
    mean = np.where(inside[..., None], normal, 0).astype(np.float64)
    if sigma > 0.1:
        mean = gaussian_filter(mean, (sigma, sigma, 0))
    return unit(mean)


def sampled(values: Array, place: Array, order: int = 3) -> Array:
    """[V, ...] of a map [H, W, ...] at places [V, 2] (x, y), by splines: with cubic ones normals turn evenly."""
    flat = np.asarray(values, np.float64).reshape(*values.shape[:2], -1)
    read = [
        map_coordinates(flat[..., k], place.T[::-1], order=order, mode="nearest")
        for k in range(flat.shape[-1])
    ]
    return np.stack(read, -1).reshape(len(place), *values.shape[2:])
