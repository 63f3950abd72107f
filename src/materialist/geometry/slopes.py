"""What a normal says about the depth next to it."""

from __future__ import annotations

import numpy as np

from materialist.types import Array

STEEPEST = 0.12
"""Smallest n.v that is followed (7 degrees): beyond, the slope runs to infinity."""


def slopes(normal: Array, rays: Array) -> tuple[Array, Array]:
    """[H, W] change of log depth from one pixel to the next that the normals demand, to the right and downwards.

    n . d(z r) = 0 along the surface gives d log z = -n . dr / (n . r).

    Args:
        normal: [H, W, 3] unit, camera frame. rays: [H, W, 2 or 3] through the pixels at z = -1, evenly spaced.
    """
    x, y = rays[..., 0], rays[..., 1]
    across = float(x[0, -1] - x[0, 0]) / max(x.shape[1] - 1, 1)
    down = float(y[-1, 0] - y[0, 0]) / max(y.shape[0] - 1, 1)
    facing = normal[..., 0] * x + normal[..., 1] * y - normal[..., 2]
    facing = np.minimum(facing, -STEEPEST * np.sqrt(x**2 + y**2 + 1))  # n . r < 0 where the surface is seen
    return -normal[..., 0] * across / facing, -normal[..., 1] * down / facing
