"""Scores of made predictions with known answers."""

from dataclasses import replace

import numpy as np
import pytest

from materialist.types import Materials, Prediction
from materialist_lab.metrics.maps import (
    aligned_psnr,
    depth_abs_rel,
    depth_figures,
    mean_angle,
    ordinal_accuracy,
    score,
    spread_calibration,
    summary,
)


@pytest.fixture
def truth():
    rng = np.random.default_rng(0)
    normal = np.zeros((24, 32, 3), np.float32)
    normal[..., 2] = 1
    depth = rng.uniform(1, 3, (24, 32)).astype(np.float32)
    # Sky in the upper rows.
    depth[:4] = 0
    maps = rng.uniform(0.1, 0.5, (24, 32, 3)), rng.uniform(0, 0.8, (24, 32)), np.zeros((24, 32))
    return Prediction(Materials(*(m.astype(np.float32) for m in maps)), normal, depth)


def test_the_truth_scores_best(truth):
    figures = score(truth, truth)
    assert figures["albedo_psnr"] == figures["roughness_psnr"] == 100
    assert figures["normal_angle"] == figures["depth_mae"] == figures["depth_si_log_rmse"] == 0
    assert figures["albedo_ssim"] == pytest.approx(1) and figures["mask_iou"] == 1


def test_one_factor_is_forgiven_in_albedo_and_depth(truth):
    darker = replace(truth.materials, albedo=truth.materials.albedo / 2)
    figures = score(replace(truth, materials=darker, depth=truth.depth * 3), truth)
    assert (
        figures["albedo_psnr"] > 90
        and figures["albedo_psnr_raw"] < 20
        and figures["albedo_scale"] == pytest.approx(2)
    )
    assert figures["depth_mae"] < 1e-5 and figures["depth_si_log_rmse"] < 1e-6
    assert figures["depth_mae_raw"] == pytest.approx(2 * truth.depth[4:].mean(), rel=1e-5)


def test_known_errors(truth):
    # Thirty degrees: sin = 1/2.
    tilt = np.zeros_like(truth.normal)
    tilt[..., 0], tilt[..., 2] = 0.5, 0.75**0.5
    rough = replace(truth.materials, roughness=truth.materials.roughness + 0.1)
    figures = score(replace(truth, materials=rough, normal=tilt), truth)
    assert figures["roughness_psnr"] == pytest.approx(20, abs=1e-3)
    assert figures["normal_angle"] == pytest.approx(30, abs=1e-3)


def test_only_surface_counts(truth):
    wrong = truth.materials.albedo.copy()
    # Errors in the sky do not count.
    wrong[:4] = 1
    figures = score(replace(truth, materials=replace(truth.materials, albedo=wrong)), truth)
    assert figures["albedo_psnr"] == 100
    noise = replace(
        truth.materials,
        roughness=np.random.default_rng(1).uniform(0, 0.8, (24, 32)).astype(np.float32),
    )
    assert score(replace(truth, materials=noise), truth)["roughness_ssim"] < 0.1
    far = replace(
        truth, depth=np.where(np.arange(24)[:, None] < 20, 0, truth.depth)
    )  # sky is no agreement
    assert score(replace(far, materials=noise), far)["roughness_ssim"] < 0.5
    assert score(truth, replace(truth, depth=np.zeros_like(truth.depth))) == {}


def test_log_error_of_depth():
    true = np.array([[1.0, 2.0, 4.0, 8.0]])
    factors = np.exp([[0.1, -0.1, 0.1, -0.1]])
    figures = depth_figures(true * factors * 5, true, true > 0)
    assert figures["depth_si_log_rmse"] == pytest.approx(0.1)
    # What is predicted as sky has no logarithm: it counts as not covered.
    holes = depth_figures(np.array([[1.0, 0.0, 0.0, 8.0]]), true, true > 0)
    assert holes["depth_coverage"] == 0.5


def test_depth_order():
    true = np.random.default_rng(1).uniform(1, 9, (40, 40))
    # Any rising function keeps the order, a falling one turns it around.
    assert ordinal_accuracy(true**2, true) == 1
    assert ordinal_accuracy(1 / true, true) == 0
    assert ordinal_accuracy(np.ones_like(true), true) == 0.5
    far = true >= np.quantile(true, 0.9)
    sky = np.where(far, 0, true)  # no surface there, which is behind everything
    # Pairs of two far pixels, 1 in 100, count half.
    assert ordinal_accuracy(sky, true) == pytest.approx(0.995, abs=0.004)
    assert ordinal_accuracy(np.random.default_rng(2).random((40, 40)), true) == pytest.approx(
        0.5, abs=0.03
    )


def test_pooled_psnr_is_of_the_mean_error():
    # PSNR of the mean squared error 0.005, and the mean of 20 and 100.
    figures = summary(
        [
            {"metallic_mse": 0.01, "metallic_psnr": 20.0},
            {"metallic_mse": 0.0, "metallic_psnr": 100.0},
        ]
    )
    assert figures["metallic_psnr"] == 60 and figures["metallic_psnr_pooled"] == pytest.approx(
        23.01, abs=0.01
    )
    assert summary([]) == {}


def test_relative_depth_after_the_median_factor():
    true = np.array([[1, 2, 4, 0]], np.float32)
    assert depth_abs_rel(np.array([[3, 6, 12, 5]], np.float32), true) == pytest.approx(0, abs=1e-6)
    assert depth_abs_rel(np.array([[1, 2, 8, 5]], np.float32), true) == pytest.approx(1 / 3)
    assert depth_abs_rel(np.array([[1, 2, 0, 5]], np.float32), true) == pytest.approx(
        1 / 3
    )  # taken for sky
    assert depth_abs_rel(np.zeros_like(true), true) == 1
    assert np.isnan(depth_abs_rel(true, np.zeros_like(true)))


def test_mean_angle_of_a_part():
    up = np.zeros((2, 2, 3), np.float32)
    out = np.zeros((2, 2, 3), np.float32)
    up[..., 1], out[..., 2] = 1, 1
    # Right in the upper half, 90 degrees off in the lower one.
    out[0] = up[0]
    everywhere = np.ones((2, 2), bool)
    assert mean_angle(up, out, everywhere) == pytest.approx(45)
    assert mean_angle(up, out, np.array([[False, False], [True, True]])) == pytest.approx(90)
    assert np.isnan(mean_angle(up, out, ~everywhere))


def test_pictures_after_one_factor():
    picture = np.random.default_rng(0).uniform(0.1, 0.9, (8, 8, 3)).astype(np.float32)
    mask = np.ones((8, 8), bool)
    assert aligned_psnr(picture / 3, picture, mask) > 90
    assert aligned_psnr(picture[::-1], picture, mask) < 20
    tinted = picture * np.array([1, 1, 0.5], np.float32)
    assert aligned_psnr(tinted, picture, mask) < 30, "one factor for all channels"
    spoilt = picture.copy()
    spoilt[:4] = 1
    assert aligned_psnr(spoilt, picture, np.arange(8)[:, None] * np.ones(8) >= 4) > 90


def test_half_of_the_errors_are_within_a_calibrated_spread(truth):
    rng = np.random.default_rng(1)
    scale = rng.uniform(0.01, 0.05, truth.depth.shape)
    # The spread is the scale of a Laplace distribution; here it is the true one.
    errors = rng.laplace(0, scale)
    rough = replace(truth.materials, roughness=truth.materials.roughness + errors)
    depth = np.where(truth.depth > 0, truth.depth * np.exp(errors), 0) * 3
    spread = {"roughness": scale, "depth": scale, "metallic": 0 * scale}
    predicted = replace(truth, materials=rough, depth=depth, spread=spread)
    coverage = spread_calibration(predicted, truth, truth.depth > 0)
    assert coverage["roughness_calibration"] == pytest.approx(0.5, abs=0.06)
    assert coverage["depth_calibration"] == pytest.approx(0.5, abs=0.06)
    assert coverage["metallic_calibration"] == 0
    assert spread_calibration(truth, truth, truth.depth > 0) == {}
