"""Light from afar: procedural skies and surroundings, and HDR captures, all turned at random and of mean about 1."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from materialist.color import luminance
from materialist.procedural import lights
from materialist.procedural.objects.solids import lumps
from materialist.types import Array

ROWS = 192
"""Rows of a procedural envmap."""


def outdoors(rng: np.random.Generator, captures: tuple[Path, ...] = ()) -> Array:
    """[h, 2h, 3] float32: a sky over ground, or (often, where there are any) a capture that is brighter above."""
    if captures and rng.random() < 0.6:
        picture = captured(rng, captures)
        if luminance(picture[: len(picture) // 3]).mean() > 0.8 * luminance(picture).mean():
            return picture
    return levelled(sky(rng))


def around(rng: np.random.Generator, captures: tuple[Path, ...] = ()) -> Array:
    """[h, 2h, 3] float32: any surroundings: captures mostly, a studio, a room, a sky."""
    if captures and rng.random() < 0.65:
        return captured(rng, captures)
    if rng.random() < 0.4:
        return levelled(sky(rng))
    radiance = lights.environment(int(rng.integers(4)), seed=int(rng.integers(2**31)), data=None)
    return levelled(radiance(lights.directions(ROWS)).astype(np.float32))


def captured(rng: np.random.Generator, captures: tuple[Path, ...]) -> Array:
    """One of the files, turned about the vertical, mirrored and tinted at random."""
    picture = _load(captures[rng.integers(len(captures))])
    picture = np.roll(picture, int(rng.integers(picture.shape[1])), axis=1)
    if rng.random() < 0.5:
        picture = picture[:, ::-1]
    return levelled(picture * np.exp(rng.normal(0, 0.06, 3)).astype(np.float32))


@lru_cache(maxsize=64)
def _load(path: Path) -> Array:
    from materialist.io.exr import read_exr

    return np.minimum(np.nan_to_num(np.maximum(read_exr(path)[..., :3], 0)), 6e4)


def levelled(envmap: Array) -> Array:
    """The map scaled to a mean luminance over the sphere of 1."""
    rows = np.sin((np.arange(len(envmap)) + 0.5) / len(envmap) * np.pi)
    mean = float((luminance(envmap).mean(1) * rows).sum() / rows.sum())
    return (envmap / max(mean, 1e-9)).astype(np.float32)


def sky(rng: np.random.Generator) -> Array:
    """[ROWS, 2 ROWS, 3]: clear, cloudy, overcast or dusk, with or without a sun, over ground."""
    d = lights.directions(ROWS)
    y = d[..., 1:2]
    elevation, azimuth = np.radians(rng.uniform(4, 70)), rng.uniform(-np.pi, np.pi)
    low = np.clip(1 - elevation / 0.6, 0, 1)
    sun = np.array([np.cos(elevation) * np.sin(azimuth), np.sin(elevation), -np.cos(elevation) * np.cos(azimuth)])
    zenith = np.array([0.18, 0.36, 0.85]) * rng.uniform(0.7, 1.2) * (1 - 0.5 * low)
    horizon = np.array([0.75, 0.85, 1.0]) * (1 - low) + np.array([1.0, 0.75, 0.5]) * low
    towards = np.clip(d @ sun, -1, 1)[..., None]
    base = horizon + (zenith - horizon) * np.clip(y, 0, 1) ** rng.uniform(0.35, 0.7)
    base = base + np.array([1.0, 0.8, 0.55]) * np.exp(-np.arccos(towards) / rng.uniform(0.1, 0.5)) * rng.uniform(
        0.2, 1.5
    )
    cover = rng.choice([0.0, rng.uniform(0.2, 0.7), 1.0], p=[0.3, 0.4, 0.3])
    cloud = _clouds(rng, d, cover)
    white = rng.uniform(0.6, 1.3) * (0.6 + 0.5 * np.clip(y, 0, 1)) * np.array([0.97, 0.98, 1.02])
    total = base * (1 - cloud) + white * cloud
    ground = np.array([0.35, 0.3, 0.22]) * rng.uniform(0.2, 1.0) * rng.uniform(0.8, 1.2, 3)
    total = np.where(y < 0, ground * (0.6 + 0.4 * np.clip(1 + y, 0, 1)), total)
    if cover < 1 and rng.random() < 0.85:
        colour = np.array([1.0, 0.93, 0.8]) * (1 - low) + np.array([1.0, 0.55, 0.25]) * low
        radius = np.radians(rng.uniform(0.6, 2.0))
        power = rng.uniform(1.0, 5.0) * (1 - 0.7 * low)  # irradiance, where the sky gives about 2
        disc = np.clip((radius + 0.005 - np.arccos(towards)) / 0.01, 0, 1)
        total = total + disc * colour * power / (np.pi * radius**2)
    return np.maximum(total, 0).astype(np.float32)


def _clouds(rng: np.random.Generator, d: Array, cover: float) -> Array:
    """[h, w, 1] opacity of clouds on a plane overhead, for directions d [h, w, 3]."""
    if cover in (0.0, 1.0):
        return np.full((*d.shape[:2], 1), cover)
    plane = d / np.maximum(d[..., 1:2], 0.08)
    field = sum(lumps(rng, 1.0 / 2**k, 0.25 * 2**k, 8)(plane) for k in range(4))
    return np.clip((field / 0.9 + 2 * cover - 1) * 2, 0, 1)[..., None] * np.clip(d[..., 1:2] / 0.1, 0, 1)
