"""What light and materials do not explain of a photo, as a factor on its re-rendering."""

import numpy as np
from scipy.ndimage import gaussian_filter

from materialist.types import Array

FLOOR = 0.004
"""Radiance added to both pictures: about one level of 8 bits."""
LIMIT = 8.0
"""Largest factor, either way."""
SIGMA = 0.7
"""Standard deviation, in pixels, over which the factor is averaged, so that it holds no noise of the rendering."""


def shading_residual(photo: Array, rerender: Array) -> Array:
    """[H, W, 3] float32 factor in [1/8, 8]: the photo is about `rerender` times it (both [H, W, 3] linear).

    It holds shading that light and geometry lack, and highlights of lights that the environment map lacks. The scene's
    albedo never includes it; exports may (`exporters.residual`). Pixels that the rendering has as NaN have 1.
    """
    # In logarithms, so that a factor and its inverse weigh alike in the mean.
    ratio = np.log((np.maximum(photo, 0) + FLOOR) / (np.maximum(rerender, 0) + FLOOR))
    # Paths of a rendering may be NaN: there the factor is 1.
    known = np.isfinite(ratio)
    smooth = gaussian_filter(np.where(known, ratio, 0), (SIGMA, SIGMA, 0))
    return np.exp(np.clip(np.where(known, smooth, 0), -np.log(LIMIT), np.log(LIMIT))).astype(
        np.float32
    )
