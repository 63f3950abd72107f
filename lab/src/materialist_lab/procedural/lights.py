"""Light from afar: procedural skies and surroundings, and HDR captures.

`environment` and `envmap` make the lights of the benchmarks, `outdoors` and `around` those of the data set, which are
turned at random and have a mean luminance of 1.
"""

import colorsys
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import turn_upright
from materialist.color import luminance
from materialist.envmap import row_solid_angle, texel_directions
from materialist.io.exr import read_exr
from materialist.types import Array
from materialist_lab.procedural import tiles
from materialist_lab.procedural.options import captures

ROWS = 256
"""Rows of an envmap (the paper's 512 x 256), as many as the captures have."""

Radiance = Callable[[Array], Array]
"""Unit directions [..., 3] in the scene frame (+Y up) -> linear radiance [..., 3]."""


def environment(
    light_index: int, *, seed: int, data: Path | None, unseen: bool = False
) -> Radiance:
    """The light of that number: a capture from DATA/envmaps/*.exr (turned at random) or a procedural one.

    unseen: only captures that no training set may use.
    Raises InputError when DATA is given but holds no captures.
    """
    rng = np.random.default_rng([seed, 3, light_index])
    if data is None:
        return _KINDS[light_index % len(_KINDS)](rng)
    files = captures(data / "envmaps", "*.exr", unseen or None)
    order = np.random.default_rng([seed, 4]).permutation(len(files))
    return _capture(files[order[light_index % len(files)]], rng.uniform(0, 2 * np.pi))


def envmap(radiance: Radiance, to_scene: Array) -> Array:
    """[ROWS, 2 ROWS, 3] float32 in the camera frame; `to_scene` [3, 3] turns camera into scene directions."""
    # Four directions a texel keep small suns from flickering between texels.
    fine = radiance(texel_directions(2 * ROWS, 4 * ROWS, np.float64) @ to_scene.T)
    return fine.reshape(ROWS, 2, 2 * ROWS, 2, 3).mean((1, 3)).astype(np.float32)


def _capture(path: Path, turn: float) -> Radiance:
    """Bilinear lookup in a captured envmap, turned about +Y by `turn` radians."""
    source = _load(path)
    h, w = source.shape[:2]
    wrapped = cv2.copyMakeBorder(source, 0, 0, 1, 1, cv2.BORDER_WRAP)

    def lookup(d: Array) -> Array:
        # Equirectangular: u = azimuth / 2 pi + 1/2, v = angle from +Y / pi.
        u = ((np.arctan2(d[..., 0], -d[..., 2]) + turn) / (2 * np.pi) + 0.5) % 1
        v = np.arccos(np.clip(d[..., 1], -1, 1)) / np.pi
        # Texel centres lie at halves; the border added on the left shifts x by one.
        x = (u * w + 0.5).astype(np.float32)
        y = (v * h - 0.5).astype(np.float32)
        return cv2.remap(wrapped, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)

    return lookup


def _axis(azimuth: float, elevation: float) -> Array:
    """[3] unit direction at an azimuth (from -Z towards +X) and elevation, radians."""
    x = np.cos(elevation) * np.sin(azimuth)
    y = np.sin(elevation)
    z = -np.cos(elevation) * np.cos(azimuth)
    return np.array([x, y, z])


def _step(x: Array, width: float) -> Array:
    """Smooth step from 0 at x = 0 to 1 at x = width."""
    t = np.clip(x / width, 0, 1)
    return t * t * (3 - 2 * t)


def _window(d: Array, axis: Array, half: tuple[float, float]) -> Array:
    """[...] 1 inside a rectangular light of angular half sizes (radians) about an axis, soft at its border."""
    # Coordinates on a plane at distance 1 across the axis, where the light is a rectangle.
    right, up, _ = turn_upright(axis).T
    front = np.maximum(d @ axis, 1e-6)
    x = np.abs(d @ right) / front
    y = np.abs(d @ up) / front
    across = _step(np.tan(half[0]) - x + 0.02, 0.04)
    inside = across * _step(np.tan(half[1]) - y + 0.02, 0.04)
    return np.where(d @ axis > 0, inside, 0)


def _tint(rng: np.random.Generator, saturation: float) -> Array:
    """[3] light colour between warm and cool, brightest channel 1."""
    hue = rng.choice([rng.uniform(0.05, 0.12), rng.uniform(0.55, 0.63)])
    return np.array(colorsys.hsv_to_rgb(hue, saturation, 1))


def _sky(rng: np.random.Generator) -> Radiance:
    """Blue or hazy gradient over a darker ground, with a sun of 2 to 5 degrees: strong contrast."""
    sun = _axis(rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(20, 65)))
    zenith = np.array([0.25, 0.45, 0.9])
    horizon = np.array([0.85, 0.9, 1.0])
    ground = np.array([0.3, 0.26, 0.2]) * rng.uniform(0.5, 1)
    width = np.radians(rng.uniform(1.5, 3))
    power = rng.uniform(0.5, 1.5)
    colour = np.array([1.0, 0.85, 0.65]) ** rng.uniform(0.5, 2)

    def radiance(d: Array) -> Array:
        y = d[..., 1:2]
        sky = horizon + (zenith - horizon) * np.clip(y, 0, 1) ** 0.6
        base = sky + (ground - sky) * (1 - _step(y + 0.03, 0.06))
        # The sun: a Gaussian disc of irradiance `power` times pi, whatever its width, and a wide glow.
        angle = np.arccos(np.clip(d @ sun, -1, 1))[..., None]
        disc = np.exp(-((angle / width) ** 2)) * (power * np.pi / (np.pi * width**2))
        return base + (disc + 0.6 * np.exp(-angle / 0.25)) * colour

    return radiance


def _overcast(rng: np.random.Generator) -> Radiance:
    """Bright cloud cover, brightest on one side: moderate contrast."""
    side = _axis(rng.uniform(-np.pi, np.pi), 0.5)
    amount = rng.uniform(0.5, 1.5)
    ground = rng.uniform(0.1, 0.3)
    tint = _tint(rng, 0.1)

    def radiance(d: Array) -> Array:
        y = d[..., 1:2]
        # Overcast sky of the CIE, L(y) = L_z (1 + 2 y) / 3, brighter on one side.
        brighter = 1 + amount * np.clip(d @ side, 0, 1)[..., None] ** 3
        sky = (1 + 2 * np.clip(y, 0, 1)) / 3 * brighter
        return (ground + (sky - ground) * _step(y + 0.1, 0.2)) * tint

    return radiance


def _studio(rng: np.random.Generator) -> Radiance:
    """Two or three soft boxes in a dim room: strong contrast."""
    ambient = rng.uniform(0.05, 0.2) * _tint(rng, 0.2)
    # (axis, angular half sizes, radiance) of each box.
    lamps = [
        (
            _axis(rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(10, 60))),
            (np.radians(rng.uniform(6, 20)), np.radians(rng.uniform(6, 16))),
            rng.uniform(4, 20) * _tint(rng, rng.uniform(0, 0.35)),
        )
        for _ in range(int(rng.integers(2, 4)))
    ]

    def radiance(d: Array) -> Array:
        total = ambient * (1 + 0.5 * d[..., 1:2])
        for axis, half, colour in lamps:
            total = total + _window(d, axis, half)[..., None] * colour
        return total

    return radiance


def _room(rng: np.random.Generator) -> Radiance:
    """A room with painted walls, a row of windows on one side and a ceiling lamp: moderate to strong contrast."""
    paint = [rng.uniform(0.15, 0.5) * _tint(rng, rng.uniform(0, 0.3)) for _ in range(4)]
    ceiling = rng.uniform(0.3, 0.6)
    floor = rng.uniform(0.05, 0.25) * np.array([1.0, 0.8, 0.6])
    azimuth = rng.uniform(-np.pi, np.pi)
    outside = rng.uniform(4, 12) * _tint(rng, 0.15)
    lamp = rng.uniform(0, 15) * np.array([1.0, 0.8, 0.55])
    windows = [_axis(azimuth + k * 0.5, np.radians(12)) for k in range(int(rng.integers(1, 4)))]

    def radiance(d: Array) -> Array:
        # A wall belongs to the larger horizontal component of a direction.
        ends = np.where(d[..., 2:] < 0, paint[0], paint[1])
        sides = np.where(d[..., :1] < 0, paint[2], paint[3])
        wall = np.where(np.abs(d[..., :1]) < np.abs(d[..., 2:]), ends, sides)
        y = d[..., 1:2]
        above = (ceiling - wall) * _step(y - 0.6, 0.02)
        below = (floor - wall) * _step(-y - 0.5, 0.02)
        total = wall + above + below
        for axis in windows:
            total = total + _window(d, axis, (0.18, 0.3))[..., None] * outside
        return total + _window(d, _axis(azimuth + 1, 1.3), (0.2, 0.2))[..., None] * lamp

    return radiance


def _clouds(rng: np.random.Generator) -> Radiance:
    """A sky of any colour between deep blue and haze, with clouds from a few to many, and a sun that they may hide."""
    # --- Sun, sky and ground ---
    sun = _axis(rng.uniform(-np.pi, np.pi), np.radians(rng.uniform(8, 70)))
    blue = colorsys.hsv_to_rgb(rng.uniform(0.54, 0.63), rng.uniform(0.3, 0.85), 1)
    zenith = np.array(blue) * rng.uniform(0.3, 0.9)
    horizon = zenith + (_tint(rng, 0.15) - zenith) * rng.uniform(0.4, 1)
    ground = np.array([0.3, 0.26, 0.2]) * rng.uniform(0.4, 1.2)
    width = np.radians(rng.uniform(1.5, 3))
    power = rng.uniform(0.1, 1.5)
    colour = _tint(rng, rng.uniform(0, 0.4))
    # --- Clouds: where noise is above a quantile, so that any share of the sky may be covered ---
    coarse = tiles.noise(rng, rng.uniform(1.4, 2))
    field = (0.75 * coarse + 0.25 * tiles.noise(rng, 1.2)).astype(np.float32)
    threshold = np.quantile(field, rng.uniform(0, 0.95))
    soft = rng.uniform(0.08, 0.4)
    thick = rng.uniform(0.3, 0.8)
    bright = rng.uniform(1, 2)
    dark = rng.uniform(0.2, 0.9)
    spacing = rng.uniform(15, 60)

    def radiance(d: Array) -> Array:
        y = d[..., 1:2]
        # Clouds lie on a plane above; where it is seen flat, haze covers them.
        at = (d[..., [0, 2]] / np.maximum(y, 0.04) * spacing).astype(np.float32)
        cover = cv2.remap(
            field, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP
        )
        above = cover[..., None] - threshold
        density = _step(above, soft) * _step(y - 0.02, 0.12)
        # Bright towards the sun, dark where they are thick.
        angle = np.arccos(np.clip(d @ sun, -1, 1))[..., None]
        towards_sun = 1 + 0.7 * np.exp(-angle / 0.4)
        shadow = 1 - (1 - dark) * _step(above, thick)
        lit = bright * towards_sun * shadow * colour
        # The disc of the sun as in `_sky`, dimmed by the clouds before it.
        sky = horizon + (zenith - horizon) * np.clip(y, 0, 1) ** 0.6
        disc = np.exp(-((angle / width) ** 2)) * (power / width**2) * (1 - density) ** 2
        sky = sky + (lit - sky) * density + (disc + 0.6 * np.exp(-angle / 0.25)) * colour
        return sky + (ground - sky) * (1 - _step(y + 0.03, 0.06))

    return radiance


_KINDS = (_sky, _studio, _room, _overcast)


def outdoors(rng: np.random.Generator, captures: tuple[Path, ...] = ()) -> Array:
    """[h, 2h, 3] float32: a sky over ground, or often, where there are any, a capture not much darker above."""
    if captures and rng.random() < 0.6:
        picture = captured(rng, captures)
        # An indoor capture is dark above: no sky.
        if luminance(picture[: len(picture) // 3]).mean() > 0.8 * luminance(picture).mean():
            return picture
    return procedural(rng, (_sky, _overcast, _clouds, _clouds))


def around(rng: np.random.Generator, captures: tuple[Path, ...] = ()) -> Array:
    """[h, 2h, 3] float32: any surroundings: captures mostly, a studio, a room, a sky."""
    if captures and rng.random() < 0.65:
        return captured(rng, captures)
    return procedural(rng, (*_KINDS, _clouds))


def procedural(
    rng: np.random.Generator, kinds: tuple[Callable[[np.random.Generator], Radiance], ...]
) -> Array:
    """[ROWS, 2 ROWS, 3] float32: one of the kinds, each as likely; its mean luminance is 1."""
    radiance = kinds[rng.integers(len(kinds))](rng)
    return levelled(radiance(texel_directions(ROWS, 2 * ROWS, np.float64)).astype(np.float32))


def captured(rng: np.random.Generator, captures: tuple[Path, ...]) -> Array:
    """One of the files, turned about the vertical, mirrored and tinted at random."""
    # Below the largest half float, in which samples are stored.
    picture = np.minimum(_load(captures[rng.integers(len(captures))]), 6e4)
    picture = np.roll(picture, int(rng.integers(picture.shape[1])), axis=1)
    if rng.random() < 0.5:
        picture = picture[:, ::-1]
    return levelled(picture * np.exp(rng.normal(0, 0.06, 3)).astype(np.float32))


@lru_cache(maxsize=64)
def _load(path: Path) -> Array:
    return np.nan_to_num(np.maximum(read_exr(path)[..., :3], 0))


def levelled(envmap: Array) -> Array:
    """The map scaled to a mean luminance over the sphere of 1."""
    rows = luminance(envmap).mean(1)
    mean = float(np.average(rows, weights=row_solid_angle(len(envmap))))
    return (envmap / max(mean, 1e-9)).astype(np.float32)
