"""Normals of a measured depth, where it is smooth: elsewhere its noise hides them."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.camera import pixel_rays, unit
from materialist.types import Array, Camera


@dataclass(frozen=True)
class SmoothSettings:
    """What counts as a smooth place; by eye on two measured rooms: walls are in, creases and edges out."""

    reach: float = 1 / 50  # half of the window's side, share of the picture's longer side
    known: float = 0.95  # share of the window's pixels that were measured
    bend: float = 0.01  # RMS distance from the plane, share of the depth


SETTINGS = SmoothSettings()


def plane_normals(depth: Array, camera: Camera) -> Array:
    """[H, W, 3] float32 unit normals of planar depth [H, W] (0: not measured), zero where no plane fits.

    On a plane the inverse depth is linear in the ray (X, Y, -1): q = a X + b Y + c, and the normal is along
    (-a, -b, c). A plane is fitted to each window by least squares; depth cameras measure disparity, so that
    their noise is even in q.
    """
    known = depth > 0
    side = 2 * max(1, round(SETTINGS.reach * max(depth.shape))) + 1

    def mean(values: Array) -> Array:
        """[H, W] mean over the window."""
        return cv2.boxFilter(values, -1, (side, side), borderType=cv2.BORDER_CONSTANT)

    # Normal equations of each window.
    inverse = np.where(known, 1 / np.where(known, depth, 1), 0).astype(np.float64)
    rays = pixel_rays(camera).astype(np.float64)
    rays[..., 2] = 1
    rays *= known[..., None]
    products = [mean(rays[..., i] * rays[..., j]) for i in range(3) for j in range(3)]
    matrix = np.stack(products, -1).reshape(*depth.shape, 3, 3)
    target = np.stack([mean(rays[..., i] * inverse) for i in range(3)], -1)  # [H, W, 3]

    # Planes, and how far the window is from them.
    share = mean(known.astype(np.float64))
    full = known & (share >= SETTINGS.known)
    plane = np.zeros_like(target)
    plane[full] = np.linalg.solve(matrix[full], target[full][..., None])[..., 0]
    square = mean(inverse**2) - (plane * target).sum(-1)
    distance = np.sqrt(np.maximum(square, 0) / np.maximum(share, 1e-9))
    smooth = full & (distance < SETTINGS.bend * inverse)
    normal = unit(plane * np.array([-1, -1, 1]))
    return np.where(smooth[..., None], normal, 0).astype(np.float32)
