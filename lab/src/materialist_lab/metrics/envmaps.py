"""How good a predicted environment map is."""

import numpy as np

from materialist import metrics
from materialist.types import Array


def envmap_metrics(estimate: Array, truth: Array) -> dict[str, float]:
    """The paper's envmap figures (table "Quantitative evaluation of envmap optimization").

    SSIM and PSNR are on the maps as they are: the photo fixes the scale of the light. MSE is on linear radiance without
    clipping. Raises InputError for maps of two sizes.
    """
    return {
        "envmap_ssim": metrics.ssim(estimate, truth),
        "envmap_psnr": metrics.psnr(estimate, truth),
        "envmap_mse": _mse_linear(estimate, truth),
        "sh_error": metrics.sh_error(estimate, truth),
        "sh_error_relative": metrics.sh_error_relative(estimate, truth),
    }


def _mse_linear(a: Array, b: Array) -> float:
    """Mean squared error of [H, W, 3] arrays of one shape as they are: linear, not clipped."""
    return float(((a.astype(np.float64) - b) ** 2).mean())
