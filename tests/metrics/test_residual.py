"""The shading residual brings a re-rendering to its photo, and does not keep the noise of the rendering."""

import numpy as np

from materialist import metrics
from materialist.metrics.residual import LIMIT, shading_residual


def test_smooth_shading_is_found_again():
    rendering = np.random.default_rng(0).uniform(0.2, 0.8, (48, 64, 3)).astype(np.float32)
    shade = np.exp(np.linspace(-1, 1, 64))[None, :, None]
    found = shading_residual(rendering * shade, rendering)
    np.testing.assert_allclose(found[4:-4, 4:-4], np.broadcast_to(shade, found.shape)[4:-4, 4:-4], rtol=0.03)
    assert metrics.psnr(rendering * found, rendering * shade) > 40


def test_noise_of_the_rendering_stays_in_the_rendering():
    photo = np.full((48, 48, 3), 0.5, np.float32)
    noisy = photo * np.random.default_rng(1).normal(1, 0.1, photo.shape).astype(np.float32)
    assert shading_residual(photo, noisy).std() < 0.05


def test_limits_and_pixels_without_a_number():
    photo, rendering = np.zeros((8, 8, 3), np.float32), np.ones((8, 8, 3), np.float32)
    rendering[0, 0] = np.nan
    found = shading_residual(photo, rendering)
    assert np.isfinite(found).all() and found.min() >= 1 / LIMIT - 1e-6
    assert shading_residual(rendering, photo)[4, 4, 0] <= LIMIT + 1e-4
