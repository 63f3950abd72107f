"""Shading that the light does not explain: creases, weaves, carving. A new colour keeps it."""

import numpy as np

from materialist.color import luminance
from materialist.types import Array, Scene

FLOOR = 0.02
"""Added to both albedos, since a ratio of two blacks is noise."""
LIMITS = (0.2, 2.0)
"""Of the factor; tuned by eye."""


def shading_detail(scene: Scene, region: Array, detail: float = 1.0) -> Array:
    """[H, W] float32 factor of a new albedo: (fitted / predicted albedo)^detail, with a median of 1 in the region.

    The network predicts the paint; the fit moves it until the rendering is the photo. What it adds is mostly shading
    finer than the geometry, and is seen on any paint.

    region: [H, W] bool, not empty. detail: in [0, 1].
    """
    fitted = luminance(scene.materials.albedo)
    predicted = luminance(scene.prior.materials.albedo)
    ratio = np.log((fitted + FLOOR) / (predicted + FLOOR))
    ratio = detail * (ratio - np.median(ratio[region]))
    return np.clip(np.exp(ratio), *LIMITS).astype(np.float32)


def shaded(colour: Array, factor: Array) -> Array:
    """[H, W, 3] colour times factor [H, W], which ends where a channel would exceed 1: the hue stays."""
    most = 1 / np.maximum(colour.max(-1), 1e-6)
    return (colour * np.minimum(factor, np.maximum(most, 1))[..., None]).astype(np.float32)
