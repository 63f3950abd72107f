"""Shading that the light does not explain: creases, weaves, carving. A new colour keeps it."""

import numpy as np

from materialist.color import luminance
from materialist.types import Array, Scene

FLOOR = 0.02
"""Added to both albedos, since a ratio of two blacks is noise."""
LIMITS = (0.2, 2.0)
"""Of the factor; tuned by eye."""
UNCLIPPED = 0.95
"""Share of a region that keeps its contrast; tuned by eye on four things in gold."""


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


def shaded(colour: Array, factor: Array, region: Array) -> Array:
    """[H, W, 3] colour times factor [H, W], in [0, 1] and in its own hue.

    A colour too bright for the factor is darkened until `UNCLIPPED` of the region [H, W] bool keep their contrast.
    """
    brightest = colour.max(-1)
    factor = factor / max(1.0, float(np.quantile((brightest * factor)[region], UNCLIPPED)))
    most = 1 / np.maximum(brightest, 1e-6)
    return (colour * np.minimum(factor, most)[..., None]).astype(np.float32)
