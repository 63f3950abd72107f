"""Light to choose from: environment maps that are computed, not photographed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from materialist.types import Array

ROWS = 128
"""Rows of the computed maps; columns are twice as many."""


def names() -> list[str]:
    """The lights in the order of the gallery."""
    return list(_LIGHTS)


def light(name: str, rows: int = ROWS) -> Array:
    """[rows, 2 rows, 3] float32 linear radiance, centre column along -Z; see docs/conventions.md."""
    return np.ascontiguousarray(_LIGHTS[name](*_directions(rows)), np.float32)


def _directions(rows: int) -> tuple[Array, Array]:
    """(azimuth, elevation) of texel centres, degrees, [rows, 2 rows] each; azimuth 0 ahead, > 0 to the right."""
    elevation = 90 - 180 * (np.arange(rows) + 0.5) / rows
    azimuth = 360 * (np.arange(2 * rows) + 0.5) / (2 * rows) - 180
    return np.meshgrid(azimuth, elevation)  # type: ignore[return-value]


def _panel(azimuth: Array, elevation: Array, at: tuple[float, float], size: tuple[float, float]) -> Array:
    """[h, w, 1]: 1 inside a soft-edged rectangle, degrees."""
    across = np.abs((azimuth - at[0] + 180) % 360 - 180) / (size[0] / 2)
    up = np.abs(elevation - at[1]) / (size[1] / 2)
    return (1 / (1 + np.exp(np.clip(14 * (np.maximum(across, up) - 1), -60, 60))))[..., None]


def _spot(azimuth: Array, elevation: Array, at: tuple[float, float], width: float) -> Array:
    """[h, w, 1]: a Gaussian of `width` degrees around a direction."""
    az, el, a0, e0 = (np.radians(v) for v in (azimuth, elevation, *at))
    cosine = np.sin(el) * np.sin(e0) + np.cos(el) * np.cos(e0) * np.cos(az - a0)
    return np.exp(-((np.degrees(np.arccos(np.clip(cosine, -1, 1))) / width) ** 2))[..., None]


def _rgb(*values: float) -> Array:
    return np.array(values, np.float32)


def _room(elevation: Array, wall: Array, floor: Array) -> Array:
    """Walls above, a floor below."""
    share = (1 / (1 + np.exp(-elevation / 6)))[..., None]
    return share * wall + (1 - share) * floor


def _softbox(azimuth: Array, elevation: Array) -> Array:
    dark = _room(elevation, _rgb(0.10, 0.10, 0.11), _rgb(0.06, 0.06, 0.06))
    key = 9 * _panel(azimuth, elevation, (-70, 40), (60, 50)) * _rgb(1.0, 0.97, 0.92)
    return dark + key + 2 * _panel(azimuth, elevation, (95, 15), (30, 80)) * _rgb(0.9, 0.95, 1.0)


def _window(azimuth: Array, elevation: Array) -> Array:
    room = _room(elevation, _rgb(0.16, 0.15, 0.14), _rgb(0.12, 0.10, 0.08))
    panes = sum(_panel(azimuth, elevation, (80 + dx, 18 + dy), (19, 24)) for dx in (-11, 11) for dy in (-14, 14))
    return room + 8 * panes * _rgb(0.85, 0.95, 1.1)


def _overcast(azimuth: Array, elevation: Array) -> Array:
    # CIE standard overcast sky: the zenith is three times as bright as the horizon.
    sky = (1 + 2 * np.sin(np.radians(np.maximum(elevation, 0))))[..., None] / 3 * _rgb(0.95, 1.0, 1.08)
    return np.where(elevation[..., None] > 0, sky, _rgb(0.22, 0.22, 0.20))


def _noon(azimuth: Array, elevation: Array) -> Array:
    height = np.sin(np.radians(np.maximum(elevation, 0)))[..., None]
    sky = (1 - height) * _rgb(0.75, 0.85, 1.0) + height * _rgb(0.22, 0.42, 0.95)
    ground = np.where(elevation[..., None] > 0, sky, _rgb(0.30, 0.27, 0.22))
    return ground + 160 * _spot(azimuth, elevation, (-50, 55), 2.5) * _rgb(1.0, 0.95, 0.85)


def _sunset(azimuth: Array, elevation: Array) -> Array:
    height = np.clip(elevation / 60, 0, 1)[..., None]
    sky = (1 - height) * _rgb(0.85, 0.42, 0.22) + height * _rgb(0.12, 0.16, 0.38)
    glow = 3 * _spot(azimuth, elevation, (75, 4), 30) * _rgb(1.0, 0.45, 0.15)
    ground = np.where(elevation[..., None] > 0, sky + glow, _rgb(0.10, 0.07, 0.06))
    return ground + 120 * _spot(azimuth, elevation, (75, 7), 2.5) * _rgb(1.0, 0.55, 0.22)


def _candle(azimuth: Array, elevation: Array) -> Array:
    room = _room(elevation, _rgb(0.05, 0.035, 0.025), _rgb(0.03, 0.02, 0.015))
    return room + 30 * _spot(azimuth, elevation, (-60, 10), 7) * _rgb(1.0, 0.55, 0.22)


def _neon(azimuth: Array, elevation: Array) -> Array:
    room = _room(elevation, _rgb(0.03, 0.03, 0.06), _rgb(0.02, 0.02, 0.03))
    pink = 7 * _panel(azimuth, elevation, (-90, 15), (10, 80)) * _rgb(1.0, 0.12, 0.5)
    return room + pink + 7 * _panel(azimuth, elevation, (90, 15), (10, 80)) * _rgb(0.1, 0.7, 1.0)


def _even(azimuth: Array, elevation: Array) -> Array:
    return np.ones((*elevation.shape, 3), np.float32)


_LIGHTS: dict[str, Callable[[Array, Array], Array]] = {
    "Softboxes": _softbox, "Window": _window, "Overcast": _overcast, "Noon": _noon, "Sunset": _sunset,
    "Candle": _candle, "Neon": _neon, "Even": _even,
}  # fmt: skip
