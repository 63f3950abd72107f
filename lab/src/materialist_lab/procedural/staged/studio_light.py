"""Light of studios and photometric captures: one or a few hard lamps in the dark, or soft boxes."""

import numpy as np

from materialist.color import luminance
from materialist.envmap import texel_directions
from materialist.types import Array
from materialist_lab.procedural import lights
from materialist_lab.procedural.staged.stock import Stock

ROWS = lights.ROWS


def hard_lamps(rng: np.random.Generator, to_camera: Array) -> Array:
    """[ROWS, 2 ROWS, 3] float32 in the scene frame: one to three small lamps, and little or nothing else.

    to_camera: [3] unit direction from the thing to the camera; the lamps stand on that side.
    """
    d = texel_directions(ROWS, 2 * ROWS, np.float64)
    ambient = 0.0 if rng.random() < 0.5 else np.exp(rng.uniform(np.log(0.002), np.log(0.1)))
    total = np.full((*d.shape[:2], 3), ambient) * (1 + 0.5 * d[..., 1:2])
    count = int(rng.choice([1, 2, 3], p=[0.75, 0.15, 0.1]))
    for k in range(count):
        axis = _around(rng, to_camera, 75.0)
        width = np.radians(np.exp(rng.uniform(np.log(0.8), np.log(8.0))))
        # A Gaussian spot; by its width squared, all lamps give about the same irradiance.
        spot = np.exp(-((np.arccos(np.clip(d @ axis, -1, 1)) / width) ** 2))[..., None]
        power = 1.0 if k == 0 else rng.uniform(0.05, 0.8)
        total = total + spot * power / width**2 * _colour(rng)
    # The scale is free, since the picture is exposed later.
    return (total / max(float(luminance(total).max()), 1e-9) * 300).astype(np.float32)


def _around(rng: np.random.Generator, axis: Array, max_degrees: float) -> Array:
    """[3] unit: a direction at most that many degrees from an axis, evenly spread over the cap, not from far below."""
    # Rejection from the sphere is even over the cap.
    for _ in range(40):
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        if d @ axis > np.cos(np.radians(max_degrees)) and d[1] > -0.3:
            return d
    return axis


def _colour(rng: np.random.Generator) -> Array:
    warm = rng.normal(0, 0.12)
    return np.array([np.exp(warm), 1.0, np.exp(-warm)])


def soft_light(rng: np.random.Generator, stock: Stock) -> Array:
    """[h, 2h, 3] float32: a studio, a room, a sky or a capture."""
    return lights.around(rng, stock.captures)
