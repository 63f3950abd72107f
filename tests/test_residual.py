"""The shading residual keeps shading and no noise."""

import numpy as np

from materialist import metrics
from materialist.residual import LIMIT, shading_residual


def test_the_residual_finds_smooth_shading_again():
    rendering = np.random.default_rng(0).uniform(0.2, 0.8, (48, 64, 3)).astype(np.float32)
    shade = np.exp(np.linspace(-1, 1, 64))[None, :, None]
    residual = shading_residual(rendering * shade, rendering)
    np.testing.assert_allclose(
        residual[4:-4, 4:-4], np.broadcast_to(shade, residual.shape)[4:-4, 4:-4], rtol=0.03
    )
    assert metrics.psnr(rendering * residual, rendering * shade) > 40


def test_noise_of_the_rendering_stays_in_the_rendering():
    photo = np.full((48, 48, 3), 0.5, np.float32)
    noisy = photo * np.random.default_rng(1).normal(1, 0.1, photo.shape).astype(np.float32)
    assert shading_residual(photo, noisy).std() < 0.05


def test_limits_of_the_residual_and_pixels_without_a_number():
    photo = np.zeros((8, 8, 3), np.float32)
    rendering = np.ones((8, 8, 3), np.float32)
    rendering[0, 0] = np.nan
    residual = shading_residual(photo, rendering)
    assert np.isfinite(residual).all() and residual.min() >= 1 / LIMIT - 1e-6
    assert shading_residual(rendering, photo)[4, 4, 0] <= LIMIT + 1e-4
