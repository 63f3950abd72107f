"""Two balls on a table, to be selected."""

import numpy as np
from edit_scenes import scene_of

from materialist.types import Camera


def table_top():
    """A textured ball with a handle, and a second ball, on a shaded floor; and the masks of the two."""
    h, w = 120, 160
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:h, :w]
    ball = (x - 60) ** 2 + (y - 60) ** 2 < 28**2
    ring = np.abs(np.hypot(x - 94, y - 60) - 12) < 3.5
    first, second = ball | (ring & (x > 85)), (x - 130) ** 2 + (y - 85) ** 2 < 14**2
    colour = np.broadcast_to([0.45, 0.42, 0.38], (h, w, 3)) * (0.7 + 0.4 * y / h)[..., None]
    colour = np.where(
        first[..., None], np.array([0.7, 0.2, 0.05]) * (0.7 + 0.5 * (60 - x) / 60)[..., None].clip(0.4, 1.3), colour
    )
    colour = np.where(second[..., None], [0.1, 0.2, 0.5], colour)
    photo = (colour * rng.uniform(0.85, 1.15, (h, w, 1))).astype(np.float32).clip(0.01, 1)
    depth = np.where(first, 2.0, np.where(second, 2.3, 3.0)).astype(np.float32)
    depth[:4] = 0
    scene = scene_of(Camera(w, h, 40.0), depth, np.broadcast_to([0, 0, 1], (h, w, 3)), photo, completion="none")
    return scene, first, second


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()
