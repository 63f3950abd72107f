"""What the light does not explain of a surface's look: creases, weaves, gloss. A new colour keeps it."""

import numpy as np

from materialist.color import luminance
from materialist.types import Array, Scene

FLOOR = 0.02
"""Added to both albedos, since a ratio of two blacks is noise."""
LIMITS = (0.2, 2.0)
"""Of the factor; tuned by eye."""
UNCLIPPED = 0.95
"""Share of a region that keeps its contrast; tuned by eye on four things in gold."""
MIN_WHITE = 0.03
"""Less is none, twice as much is whole: the fit adds a little anywhere; tuned on nine made objects."""
WHITE_RIDGE = 0.03
"""Added to the square of white: of grey paint, which has the same direction, none is white; tuned by eye."""


def highlights(scene: Scene, region: Array) -> Array:
    """[H, W] float32 in [0, 1]: white in the fitted albedo that the predicted one lacks, beyond its median.

    The network predicts the paint, white patterns included; the fit leaves mirrored light in the albedo.
    """
    fitted = white_share(scene.materials.albedo, region)
    added = fitted - white_share(scene.prior.materials.albedo, region)
    added = np.clip(added - max(float(np.median(added[region])), 0), 0, 1)
    return (added * np.clip(added / MIN_WHITE - 1, 0, 1)).astype(np.float32)


def white_share(albedo: Array, region: Array) -> Array:
    """[H, W] w of the dichromatic model (Shafer 1985), albedo [H, W, 3] = s paint + w white.

    The paint has the median chromaticity of the region [H, W] bool; least squares with w >= 0 and a ridge on it.
    """
    chroma = albedo / np.maximum(luminance(albedo)[..., None], FLOOR)
    paint = np.median(chroma[region], axis=0)
    paint = paint / max(float(np.linalg.norm(paint)), 1e-6)
    white = np.full(3, 3**-0.5)
    # The normal equations, along unit vectors.
    along = float(paint @ white)
    share = (albedo @ white - along * (albedo @ paint)) / (1 + WHITE_RIDGE - along**2)
    # No more than all of it; a channel has 1 / sqrt(3) of the vector.
    return np.clip(share, 0, albedo @ white) * 3**-0.5


def shading_detail(
    scene: Scene, region: Array, detail: float = 1.0, white: Array | float = 0.0
) -> Array:
    """[H, W] float32 factor of a new albedo: (fitted / predicted albedo)^detail, with a median of 1 in the region.

    The network predicts the paint; the fit moves it until the rendering is the photo. What it adds is mostly shading
    finer than the geometry, and is seen on any paint.

    region: [H, W] bool, not empty. detail: in [0, 1]. white: [H, W] what of the fitted albedo is no paint.
    """
    fitted = np.maximum(luminance(scene.materials.albedo) - white, 0)
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
