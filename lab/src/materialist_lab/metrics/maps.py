"""How good predicted maps are: the figures of the paper's Table 1, raw and after one scale where scale is ambiguous.

The protocol is that of `bench materials`: the light's brightness cannot be told from the albedo's, nor a depth's unit.
"""

import numpy as np

from materialist.color import linear_to_srgb
from materialist.metrics import mse, ssim, ssim_of_values
from materialist.types import Array, Prediction

MIN_SURFACE = 0.01
"""A picture with less surface than this share of its pixels is not scored."""
PAIRS = 50_000
"""Pixel pairs whose order in depth is compared."""
MIN_DIFFERENCE = 0.02
"""Relative difference in depth from which a pair has an order."""


def score(predicted: Prediction, true: Prediction) -> dict[str, float]:
    """All figures for one picture; maps of both have one size.

    Keys: albedo_psnr, albedo_ssim (aligned), albedo_psnr_raw, albedo_ssim_raw, albedo_scale, roughness_psnr,
    roughness_ssim, metallic_psnr, metallic_ssim, depth_mae, depth_rmse (aligned), depth_mae_raw, depth_rmse_raw,
    depth_si_log_rmse, depth_coverage, normal_angle, mask_iou. PSNR in dB, angle in degrees. Empty when there is
    next to no surface. Square errors are given as *_mse as well, so that a set can be pooled.
    """
    surface = true.depth > 0
    if surface.mean() < MIN_SURFACE:
        return {}
    # --- Materials ---
    figures = _albedo(predicted.materials.albedo, true.materials.albedo, surface)
    for name in ("roughness", "metallic"):
        p = getattr(predicted.materials, name)
        t = getattr(true.materials, name)
        figures[f"{name}_mse"] = float(np.square(p - t, dtype=np.float64)[surface].mean())
        figures[f"{name}_psnr"] = decibel(figures[f"{name}_mse"])
        figures[f"{name}_ssim"] = ssim_of_values(np.where(surface, p, t), t, mask=surface)
    # --- Geometry ---
    figures |= depth_figures(predicted.depth, true.depth, surface)
    figures["normal_angle"] = mean_angle(predicted.normal, true.normal, surface)
    figures |= spread_calibration(predicted, true, surface)
    # --- Where each sees a surface at all ---
    p = predicted.depth > 0
    t = true.depth > 0
    return {**figures, "mask_iou": float((p & t).sum() / max((p | t).sum(), 1))}


def spread_calibration(predicted: Prediction, true: Prediction, surface: Array) -> dict[str, float]:
    """Share of the surface whose error is below the median that the prediction expects: 0.5 where it is calibrated.

    Keys: albedo_calibration, roughness_calibration, ...; none without a spread. The median of a Laplace distribution's
    absolute error is ln 2 times its mean. Depth is compared where both have it, after its median difference is removed.
    """
    both = surface & (predicted.depth > 0)
    if not predicted.spread or not both.any():
        return {}
    errors = map_errors(predicted, true, both)
    return {
        f"{name}_calibration": float((errors[name] < np.log(2) * spread[both]).mean())
        for name, spread in predicted.spread.items()
    }


def map_errors(predicted: Prediction, true: Prediction, surface: Array) -> dict[str, Array]:
    """[N] absolute errors over a surface [H, W] bool, as `Prediction.spread` counts them."""
    predicted_albedo = linear_to_srgb(predicted.materials.albedo[surface])
    true_albedo = linear_to_srgb(true.materials.albedo[surface])
    errors = {"albedo": np.abs(predicted_albedo - true_albedo).mean(-1)}
    for name in ("roughness", "metallic"):
        ours = getattr(predicted.materials, name)[surface]
        theirs = getattr(true.materials, name)[surface]
        errors[name] = np.abs(ours - theirs)
    cosine = (predicted.normal * true.normal).sum(-1)[surface]
    errors["normal"] = np.arccos(np.clip(cosine, -1, 1))
    # Relative depth has no scale: the median difference of the logarithms is taken out.
    difference = np.log(predicted.depth[surface]) - np.log(true.depth[surface])
    errors["depth"] = np.abs(difference - np.median(difference))
    return errors


def depth_figures(predicted: Array, true: Array, surface: Array) -> dict[str, float]:
    """Figures of planar depth [H, W] against true depth over `surface`; see `score`."""
    both = surface & (predicted > 0)
    figures = {"depth_coverage": float(both.sum() / max(surface.sum(), 1))}
    if both.sum() < 2:
        return figures
    p = predicted[both].astype(np.float64)
    t = true[both].astype(np.float64)
    # Least squares: a predicted depth has no unit of its own.
    scale = (p * t).sum() / (p * p).sum()
    for suffix, estimate in (("", p * scale), ("_raw", p)):
        figures[f"depth_mae{suffix}"] = float(np.abs(estimate - t).mean())
        figures[f"depth_rmse{suffix}"] = float(np.sqrt(np.square(estimate - t).mean()))
    figures["depth_si_log_rmse"] = float(np.std(np.log(p) - np.log(t)))
    return figures


def depth_abs_rel(predicted: Array, true: Array) -> float:
    """Mean of |predicted - true| / true of planar depth [H, W] after one factor, the median of true / predicted.

    Pixels without true depth are left out; a pixel that is predicted to have none counts as an error of 1.
    """
    surface = true > 0
    both = (true > 0) & (predicted > 0)
    if not both.any():
        return 1.0 if surface.any() else float("nan")
    factor = np.median(true[both] / predicted[both])
    error = np.where(both, np.abs(factor * predicted - true) / np.where(surface, true, 1), 1)
    return float(error[surface].mean())


def mean_angle(predicted: Array, true: Array, surface: Array) -> float:
    """Mean angle in degrees between unit normals [H, W, 3] over `surface` [H, W] bool; NaN where it is empty."""
    if not surface.any():
        return float("nan")
    cosine = np.clip((predicted * true).sum(-1), -1, 1)[surface]
    return float(np.degrees(np.arccos(cosine)).mean())


def aligned_psnr(picture: Array, true: Array, mask: Array) -> float:
    """PSNR in dB of a linear picture [H, W, 3] after the one factor that brings it nearest to the true one.

    Both are cut at 1 for the factor (least squares of linear values), as they are for the PSNR (sRGB-encoded); `mask`
    [H, W] bool: what counts. At most 100, so that means stay finite.
    """
    scale = best_scale(np.minimum(picture, 1), np.minimum(true, 1), mask)
    return decibel(mse(picture * np.float32(scale), true, mask=mask))


def ordinal_accuracy(predicted: Array, true: Array) -> float:
    """Part of random pixel pairs whose order in depth [H, W] is right; those closer than MIN_DIFFERENCE do not count.

    A tie in the prediction counts half, so that a constant gets 0.5. Pixels without true depth are left out; what is
    predicted to have none (0) is sky, behind everything.
    """
    # A fixed seed: the same pairs for every prediction of a picture.
    rng = np.random.default_rng(0)
    known = np.flatnonzero(true > 0)
    first = rng.choice(known, PAIRS)
    second = rng.choice(known, PAIRS)
    t = np.log(true.ravel()[first]) - np.log(true.ravel()[second])
    clear = np.abs(t) > np.log1p(MIN_DIFFERENCE)
    depth = np.where(predicted > 0, predicted, np.inf).ravel()
    a = depth[first]
    b = depth[second]
    right = np.where(a == b, 0.5, (a > b) == (t > 0))
    return float(right[clear].mean()) if clear.any() else float("nan")


def summary(rows: list[dict[str, float]]) -> dict[str, float]:
    """Mean of every figure over pictures, and PSNRs of the pooled square error as NAME_psnr_pooled."""
    if not rows:
        return {}
    keys = dict.fromkeys(key for row in rows for key in row)
    means = {}
    for key in keys:
        values = [row[key] for row in rows if key in row and np.isfinite(row[key])]
        if values:
            means[key] = float(np.mean(values))
    # A pooled PSNR weighs every picture by its error, where the mean of PSNRs lets dark pictures
    # rule.
    for key in [k for k in means if k.endswith("_mse")]:
        means[key.replace("_mse", "_psnr_pooled")] = decibel(means[key])
    return means


def decibel(square_error: float) -> float:
    """PSNR in dB of a mean square error of values in [0, 1]; 100 for none, so that means stay finite."""
    return float(-10 * np.log10(max(square_error, 1e-10)))


def best_scale(predicted: Array, true: Array, surface: Array) -> float:
    """The factor that brings linear values nearest to the true ones over `surface` [H, W] (least squares)."""
    p = predicted[surface].astype(np.float64)
    t = true[surface].astype(np.float64)
    return float((p * t).sum() / max((p * p).sum(), 1e-12))


def _albedo(predicted: Array, true: Array, surface: Array) -> dict[str, float]:
    scale = best_scale(predicted, true, surface)
    figures = {"albedo_scale": scale}
    for suffix, estimate in (("", predicted * np.float32(scale)), ("_raw", predicted)):
        difference = (
            linear_to_srgb(estimate)[surface].astype(np.float64) - linear_to_srgb(true)[surface]
        )
        figures[f"albedo{suffix}_mse"] = float(np.square(difference).mean())
        figures[f"albedo_psnr{suffix}"] = decibel(figures[f"albedo{suffix}_mse"])
        # Windows at the border of the surface see no difference beyond it.
        filled = np.where(surface[..., None], estimate, true)
        figures[f"albedo_ssim{suffix}"] = ssim(filled, true, mask=surface)
    return figures
