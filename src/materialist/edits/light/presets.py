"""Light to choose from: environment maps that are computed, not photographed."""

from collections.abc import Callable

import numpy as np

from materialist.types import Array

ROWS = 128
"""Rows of the computed maps; columns are twice as many."""
Colour = tuple[float, float, float]


def preset_light(name: str, rows: int = ROWS) -> Array:
    """[rows, 2 rows, 3] float32 linear radiance, centre column along -Z; see docs/conventions.md."""
    elevation = 90 - 180 * (np.arange(rows) + 0.5) / rows
    azimuth = 360 * (np.arange(2 * rows) + 0.5) / (2 * rows) - 180
    return np.ascontiguousarray(LIGHTS[name](*np.meshgrid(azimuth, elevation)), np.float32)


def _panel(
    az: Array, el: Array, at: tuple[float, float], size: tuple[float, float], colour: Colour
) -> Array:
    """[h, w, 3]: a soft-edged rectangle; `at` and `size` in degrees."""
    # 1 at the border of the rectangle, below inside; a logistic curve makes it soft.
    across = np.abs((az - at[0] + 180) % 360 - 180) / (size[0] / 2)
    up = np.abs(el - at[1]) / (size[1] / 2)
    return (1 / (1 + np.exp(np.clip(14 * (np.maximum(across, up) - 1), -60, 60))))[
        ..., None
    ] * np.array(colour)


def _spot(az: Array, el: Array, at: tuple[float, float], width: float, colour: Colour) -> Array:
    """[h, w, 3]: a Gaussian of `width` degrees around a direction."""
    # Spherical law of cosines: the angle between each direction and the spot.
    a, e, a0, e0 = (np.radians(v) for v in (az, el, *at))
    cosine = np.sin(e) * np.sin(e0) + np.cos(e) * np.cos(e0) * np.cos(a - a0)
    return np.exp(-((np.degrees(np.arccos(np.clip(cosine, -1, 1))) / width) ** 2))[
        ..., None
    ] * np.array(colour)


def _room(el: Array, wall: Colour, floor: Colour) -> Array:
    """[h, w, 3]: walls above, a floor below."""
    share = (1 / (1 + np.exp(-el / 6)))[..., None]
    return share * np.array(wall) + (1 - share) * np.array(floor)


def _sky(el: Array, share: Array, low: Colour, high: Colour, ground: Colour) -> Array:
    """[h, w, 3]: from `low` at the horizon to `high`, by a share [h, w] of the way, over a ground."""
    sky = (1 - share[..., None]) * np.array(low) + share[..., None] * np.array(high)
    return np.where(el[..., None] > 0, sky, np.array(ground))


def _up(el: Array) -> Array:
    return np.sin(np.radians(np.maximum(el, 0)))


LIGHTS: dict[str, Callable[[Array, Array], Array]] = {
    "Softboxes": lambda az, el: (
        _room(el, (0.10, 0.10, 0.11), (0.06, 0.06, 0.06))
        + _panel(az, el, (-70, 40), (60, 50), (9, 8.73, 8.28))
        + _panel(az, el, (95, 15), (30, 80), (1.8, 1.9, 2))
    ),
    "Window": lambda az, el: (
        _room(el, (0.16, 0.15, 0.14), (0.12, 0.10, 0.08))
        + sum(_panel(az, el, (x, y), (19, 24), (6.8, 7.6, 8.8)) for x in (69, 91) for y in (4, 32))
    ),
    # CIE standard overcast sky: the zenith is three times as bright as the horizon.
    "Overcast": lambda az, el: _sky(
        el, _up(el), (0.95 / 3, 1 / 3, 0.36), (0.95, 1.0, 1.08), (0.22, 0.22, 0.20)
    ),
    "Noon": lambda az, el: (
        _sky(el, _up(el), (0.75, 0.85, 1.0), (0.22, 0.42, 0.95), (0.30, 0.27, 0.22))
        + _spot(az, el, (-50, 55), 2.5, (160, 152, 136))
    ),
    "Sunset": lambda az, el: (
        _sky(el, np.clip(el / 60, 0, 1), (0.85, 0.42, 0.22), (0.12, 0.16, 0.38), (0.10, 0.07, 0.06))
        + np.where(el[..., None] > 0, _spot(az, el, (75, 4), 30, (3, 1.35, 0.45)), 0)
        + _spot(az, el, (75, 7), 2.5, (120, 66, 26.4))
    ),
    "Candle": lambda az, el: (
        _room(el, (0.05, 0.035, 0.025), (0.03, 0.02, 0.015))
        + _spot(az, el, (-60, 10), 7, (30, 16.5, 6.6))
    ),
    "Even": lambda az, el: np.ones((*el.shape, 3)),
}
"""Name -> radiance [h, w, 3] at azimuths and elevations [h, w], degrees; in the order of the gallery."""
