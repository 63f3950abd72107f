"""What the light does not explain of a surface's look: creases, weaves, gloss. A new colour keeps it."""

import numpy as np

from materialist.color import luminance
from materialist.geometry.silhouette import window
from materialist.types import Array, Scene

FLOOR = 0.02
"""Added to both albedos, since a ratio of two blacks is noise."""
LIMITS = (0.2, 2.0)
"""Of the factor; tuned by eye."""
UNCLIPPED = 0.95
"""Share of a region that keeps its contrast; tuned by eye on four things in gold."""
DARK = 2e-3
"""Added to albedos whose chromaticity counts: black has none."""
MIN_WHITE = 0.03
"""Less is none, twice as much is whole: the fit adds a little anywhere; tuned on nine made objects."""
SAME_PAINT = 0.08
"""Standard deviation of the chromaticity, a vector of unit length, of one paint."""
WHITE_RIDGE = 0.03
"""Added to the square of white: of grey paint, which has the same direction, none is white; tuned by eye."""


def core_of(weight: Array) -> Array:
    """[H, W] bool: the pixels of a weight [H, W] that say what its region looks like."""
    return weight > 0.5 if (weight > 0.5).any() else weight > 0


def highlights(scene: Scene, weight: Array) -> Array:
    """[H, W] float32 in [0, 1]: white in the fitted albedo that the predicted one lacks, beyond its median.

    The network predicts the paint, white patterns included; the fit leaves mirrored light in the albedo. By the
    dichromatic model (Shafer 1985) albedo = s paint + w white; the paint has the median chromaticity of the region
    of a weight [H, W]; 0 where that is 0.
    """
    white = np.zeros(weight.shape, np.float32)
    box = window(weight > 0)
    fitted = scene.materials.albedo[box]
    inside = core_of(weight)[box]
    chroma = (fitted + DARK) / (luminance(fitted) + DARK)[..., None]
    paint = np.median(chroma[inside], axis=0)
    added = white_share(fitted, paint) - white_share(scene.prior.materials.albedo[box], paint)
    added = np.clip(added - max(float(np.median(added[inside])), 0), 0, 1)
    white[box] = added * np.clip(added / MIN_WHITE - 1, 0, 1)
    return white


def white_share(albedo: Array, paint: Array) -> Array:
    """[...] w >= 0 of albedo [..., 3] = s paint + w white: least squares with a ridge on w.

    paint: [3], of any length.
    """
    paint = paint / np.linalg.norm(paint)
    white = np.full(3, 3**-0.5)
    # The normal equations, along unit vectors.
    along = float(paint @ white)
    share = (albedo @ white - along * (albedo @ paint)) / (1 + WHITE_RIDGE - along**2)
    # No more than each channel has, or another hue would be white.
    return np.clip(share * 3**-0.5, 0, albedo.min(-1))


def shading_detail(
    scene: Scene,
    region: Array,
    detail: float = 1.0,
    metallic: Array | float = 0.0,
    white: Array | float = 0.0,
) -> Array:
    """[H, W] float32 factor of a new albedo: (fitted albedo / pattern)^detail, with a median of 1 in the region.

    What the fit adds to the predicted albedo is mostly shading finer than the geometry, and is seen on any paint. The
    network leaves shading in its albedo, too: what has the chromaticity of the region's paint is no pattern, unless the
    new surface is metal, which has reflections in place of shades.

    region: [H, W] bool, not empty. detail: in [0, 1]. metallic: [H, W] of the new surface. white: [H, W] what of the
    fitted albedo is no paint.
    """
    fitted = np.maximum(luminance(scene.materials.albedo) - white, 0)
    predicted = scene.prior.materials.albedo
    pattern = np.log(luminance(predicted) + FLOOR)
    shading = likeness(predicted, region) * (1 - metallic)
    pattern = pattern + shading * (np.median(pattern[region]) - pattern)
    ratio = np.log(fitted + FLOOR) - pattern
    ratio = detail * (ratio - np.median(ratio[region]))
    return np.clip(np.exp(ratio), *LIMITS).astype(np.float32)


def likeness(albedo: Array, region: Array) -> Array:
    """[H, W] in [0, 1]: how far an albedo [H, W, 3] has the median chromaticity of a region [H, W] bool."""
    colour = albedo + DARK
    chromaticity = colour / np.linalg.norm(colour, axis=-1, keepdims=True)
    paint = np.median(chromaticity[region], axis=0)
    apart = np.linalg.norm(chromaticity - paint, axis=-1) / SAME_PAINT
    return np.exp(-0.5 * apart**2)


def shaded(colour: Array, factor: Array, region: Array) -> Array:
    """[H, W, 3] colour times factor [H, W], in [0, 1] and in its own hue.

    A colour too bright for the factor is darkened until `UNCLIPPED` of the region [H, W] bool keep their contrast.
    """
    brightest = colour.max(-1)
    factor = factor / max(1.0, float(np.quantile((brightest * factor)[region], UNCLIPPED)))
    most = 1 / np.maximum(brightest, 1e-6)
    return (colour * np.minimum(factor, most)[..., None]).astype(np.float32)
