"""What is measured on a real photograph; every layout has the same figures, as far as its truth goes."""

import numpy as np

from materialist.types import Array, Prediction
from materialist_lab.bench.real.photos import RealPhoto
from materialist_lab.bench.whdr import judged
from materialist_lab.metrics.maps import aligned_psnr, depth_abs_rel, mean_angle, ordinal_accuracy

LEVEL = 0.7
"""Least upward part of the normal of a floor or a table top, which are easy: most networks know them."""


def map_figures(maps: Prediction, real: RealPhoto) -> dict[str, float]:
    """Figures of predicted maps; without those whose truth is not known."""
    figures = albedo_figures(maps.materials.albedo, real)
    if real.normal is not None:
        known = real.inside & real.normal.any(-1)
        figures["normal_angle"] = mean_angle(maps.normal, real.normal, known)
        if real.depth is not None:
            steep = known & (real.normal[..., 1] < LEVEL)
            figures["steep_angle"] = mean_angle(maps.normal, real.normal, steep)
    if real.depth is not None:
        true = np.where(real.inside, real.depth, 0)
        figures["depth_abs_rel"] = depth_abs_rel(maps.depth, true)
        figures["depth_order"] = ordinal_accuracy(maps.depth, true)
    return figures


def albedo_figures(albedo: Array, real: RealPhoto) -> dict[str, float]:
    """Figures of an albedo [H, W, 3] linear, such as the photo itself."""
    figures = {}
    if real.albedo is not None:
        figures["albedo_psnr"] = aligned_psnr(albedo, real.albedo, real.inside)
    if real.judgements is not None:
        figures["whdr"] = judged(albedo, real.judgements)[0]
    return figures


def light_figures(picture: Array, real: RealPhoto) -> dict[str, float]:
    """How near a picture [H, W, 3] linear is to the photo under another light."""
    if real.other is None:
        return {}
    return {"relit_psnr": aligned_psnr(picture, real.other.picture, real.inside)}
