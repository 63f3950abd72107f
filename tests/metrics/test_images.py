"""Metrics against closed forms."""

import numpy as np
import pytest

from materialist import metrics
from materialist.color import srgb_to_linear
from materialist.envmap import texel_directions
from materialist.errors import InputError

H = 64


def test_psnr_of_a_known_offset_on_the_srgb_encoding():
    a = np.full((8, 8, 3), srgb_to_linear(0.5), np.float32)
    b = np.full((8, 8, 3), srgb_to_linear(0.6), np.float32)
    assert metrics.psnr(a, b) == pytest.approx(20.0, abs=1e-3)
    assert metrics.mse(a, b) == pytest.approx(0.01, rel=1e-4)
    assert metrics.psnr(a, a) == float("inf")


def test_values_above_one_are_clipped_in_psnr():
    a = np.full((4, 4, 3), 2.0)
    b = np.full((4, 4, 3), 7.0)
    assert metrics.psnr(a, b) == float("inf")


def test_mask_restricts_the_mean():
    a = np.zeros((4, 4, 3), np.float32)
    b = a.copy()
    b[0, 0] = 1
    mask = np.ones((4, 4), bool)
    mask[0, 0] = False
    assert metrics.mse(a, b) == pytest.approx(1 / 16)
    assert metrics.mse(a, b, mask=mask) == 0
    with pytest.raises(InputError, match="no pixel"):
        metrics.mse(a, b, mask=np.zeros((4, 4), bool))


def test_ssim_is_one_for_equal_pictures_and_falls_with_structure_lost():
    rng = np.random.default_rng(0)
    picture = rng.random((32, 40, 3)).astype(np.float32)
    assert metrics.ssim(picture, picture) == pytest.approx(1)
    assert metrics.ssim(picture, np.full_like(picture, picture.mean())) < 0.1
    assert metrics.ssim(picture[:5, :7], picture[:5, :7]) == pytest.approx(1)
    # Two flat pictures have no variance: SSIM is then its luminance term alone.
    x = 0.25
    y = 0.75
    c1 = 0.01**2
    flat = metrics.ssim(
        np.full((16, 16, 3), srgb_to_linear(x)), np.full((16, 16, 3), srgb_to_linear(y))
    )
    assert flat == pytest.approx((2 * x * y + c1) / (x * x + y * y + c1), abs=1e-4)


@pytest.mark.parametrize("name", ["psnr", "ssim"])
def test_noise_of_two_halves_is_taken_out(name):
    clean = getattr(metrics, name)
    corrected = getattr(metrics, f"{name}_without_noise")
    rng = np.random.default_rng(5)
    photo = np.clip(
        0.4 + 0.2 * np.sin(np.indices((96, 96)).sum(0) / 7)[..., None] * [1, 0.5, -1], 0, 1
    )
    rendered = photo * [0.9, 1.0, 1.1]
    halves = [rendered + rng.normal(0, 0.03, photo.shape) for _ in range(2)]
    wanted = clean(rendered, photo)
    noisy = clean(sum(halves) / 2, photo)
    found = corrected(*halves, photo)
    assert corrected(rendered, rendered, photo) == pytest.approx(wanted, rel=1e-3)
    assert abs(found - wanted) < 0.1 * abs(noisy - wanted)


@pytest.mark.parametrize("axis", [(0, 1, 0), (0, 0, -1), (1, 0, 0), (0.48, -0.6, 0.64)])
def test_linear_map_is_degree_one_with_norm_of_its_gradient(axis):
    """E(d) = d . a has only degree 1 with norm |a| sqrt(4 pi / 3)."""
    value = texel_directions(H, 2 * H) @ np.asarray(axis, float)
    coefficients = metrics.sh_coefficients(np.repeat(value[..., None], 3, 2))[:, 0]
    assert np.linalg.norm(coefficients[1:4]) == pytest.approx(np.sqrt(4 * np.pi / 3), rel=1e-3)
    assert np.abs(np.delete(coefficients, [1, 2, 3])).max() < 2e-3


def test_sh_error_of_constant_maps_is_the_difference_times_root_four_pi():
    a = np.full((H, 2 * H, 3), 1.0)
    b = np.full((16, 32, 3), 3.0)
    assert metrics.sh_error(a, b) == pytest.approx(2 * np.sqrt(4 * np.pi), rel=1e-4)
    assert metrics.sh_error_relative(b, a) == pytest.approx(2, rel=1e-4)
    red = a.copy()
    red[..., 0] = 3
    assert metrics.sh_error(a, red) == pytest.approx(2 * np.sqrt(4 * np.pi / 3), rel=1e-4)
