"""Procedural albedo patterns: seamless colour pictures."""

import colorsys

import numpy as np

from materialist.types import Array
from materialist_lab.procedural.materials import ANY_COLOUR, shade
from materialist_lab.procedural.tiles import SIZE, X, Y, noise

UNSATURATED = ANY_COLOUR[:3]
"""The shades of `natural` patterns."""


def pattern(
    rng: np.random.Generator, kind: str, *, metal: bool = False, natural: bool = False
) -> Array:
    """A seamless picture [SIZE, SIZE, 3] float32 linear, albedo in [0.03, 0.9].

    `kind` is 'plain', 'checker', 'noise', 'stripes', 'wood' or 'spots'; metals are bright and weakly coloured.
    `natural`: colours as often as things have them, greys and beiges most.
    """
    first = _colour(rng, metal, natural)
    second = _colour(rng, metal, natural) if rng.random() < 0.5 else first * rng.uniform(0.25, 0.6)
    mix = _KINDS[kind](rng)[..., None]  # [SIZE, SIZE, 1] in [0, 1]
    grain = 1 + 0.05 * (noise(rng, 1.0)[..., None] - 0.5)
    return np.clip((first * (1 - mix) + second * mix) * grain, 0.03, 0.9).astype(np.float32)


def _colour(rng: np.random.Generator, metal: bool, natural: bool) -> Array:
    """[3] linear colour of a dielectric (any hue) or of a metal (silver, gold, copper)."""
    if metal:
        # Silver, gold, copper, steel.
        base = np.array(
            [(0.9, 0.88, 0.86), (0.85, 0.64, 0.30), (0.82, 0.50, 0.36), (0.60, 0.60, 0.62)]
        )
        return base[rng.integers(len(base))] * rng.uniform(0.85, 1)
    if natural:
        return np.array(shade(rng, UNSATURATED))
    value = rng.uniform(0.12, 0.8)
    saturation = rng.choice([rng.uniform(0, 0.15), rng.uniform(0.3, 0.85)])
    return np.array(colorsys.hsv_to_rgb(rng.random(), saturation, value))


def _checker(rng: np.random.Generator) -> Array:
    # An even number of fields: the picture repeats without a seam.
    n = 2 * int(rng.integers(2, 5))
    return ((np.floor(X * n) + np.floor(Y * n)) % 2).astype(float)


def _stripes(rng: np.random.Generator) -> Array:
    n = int(rng.integers(3, 9))
    m = int(rng.integers(0, 3))
    return np.clip(0.5 + 2 * np.sin(2 * np.pi * (n * Y + m * X)), 0, 1)


def _wood(rng: np.random.Generator) -> Array:
    n = int(rng.integers(5, 10))
    # Rings along x, bent by noise and by one wave.
    bend = 1.2 * noise(rng, 2.0) + 0.3 * np.sin(2 * np.pi * X)
    rings = 0.5 + 0.5 * np.sin(2 * np.pi * (n * Y + bend))
    return np.clip(0.7 * rings**2 + 0.3 * noise(rng, 0.8), 0, 1)


def _spots(rng: np.random.Generator) -> Array:
    mix = np.zeros((SIZE, SIZE))
    for _ in range(int(rng.integers(8, 24))):
        cx = rng.random()
        cy = rng.random()
        radius = rng.uniform(0.03, 0.1)
        # From the nearest repetition of the spot, so that the picture has no seams.
        distance = np.hypot((X - cx + 0.5) % 1 - 0.5, (Y - cy + 0.5) % 1 - 0.5)
        mix = np.maximum(mix, np.clip((radius - distance) * SIZE / 2, 0, 1))
    return mix


_KINDS = {
    "plain": lambda rng: np.zeros((SIZE, SIZE)),
    "checker": _checker,
    "noise": lambda rng: noise(rng, 1.6),
    "stripes": _stripes,
    "wood": _wood,
    "spots": _spots,
}
KINDS = tuple(_KINDS)
