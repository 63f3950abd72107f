"""Losses against closed forms."""

import numpy as np
import pytest
import torch

from materialist.color import linear_to_srgb
from materialist.fit.losses import (
    CLIPPED,
    consistency,
    encode,
    l1_l2,
    log_chroma,
    log_total_variation,
    residual,
    too_pure,
)


def test_srgb_encoding_is_the_packages():
    x = np.linspace(0, 1, 200, dtype=np.float32)
    np.testing.assert_allclose(encode(torch.from_numpy(x), "srgb").numpy(), linear_to_srgb(x), atol=2e-6)


def test_srgb_encoding_goes_on_above_one_with_a_gradient():
    """A rendering brighter than white must still be pulled back."""
    x = torch.tensor([1.0, 2.0, 8.0], requires_grad=True)
    value = encode(x, "srgb")
    assert (value.diff() > 0.1).all()
    (gradient,) = torch.autograd.grad(value.sum(), x)
    assert (gradient > 0).all()


def test_srgb_encoding_has_finite_gradients_at_black():
    x = torch.tensor([0.0, 1e-6, 0.0031308, 0.0032], requires_grad=True)
    (gradient,) = torch.autograd.grad(encode(x, "srgb").sum(), x)
    torch.testing.assert_close(gradient[:2], torch.full((2,), 12.92))
    assert torch.isfinite(gradient).all()


def test_other_encodings():
    x = torch.tensor([0.0, 0.5, 10.0])
    assert encode(x, "linear") is x
    torch.testing.assert_close(encode(x, "log1p"), torch.log(1 + x))  # paper, Handling HDR Images


def test_clipped_channels_are_wrong_on_one_side_only():
    photo = torch.tensor([[0.5, CLIPPED, 1.0]])
    brighter, darker = photo + 0.4, photo - 0.4
    torch.testing.assert_close(residual(brighter, photo, "linear", clipped=True), torch.tensor([[0.4, 0, 0]]))
    torch.testing.assert_close(residual(darker, photo, "linear", clipped=True), torch.full((1, 3), -0.4))
    torch.testing.assert_close(residual(brighter, photo, "linear", clipped=False), torch.full((1, 3), 0.4))


def test_colours_that_are_too_pure_are_no_error_of_light():
    """Orange without any blue; a shadow is dark in all channels, and known."""
    photo = torch.tensor([[0.7, 0.06, 0.0], [0.01, 0.001, 0.0], [0.7, 0.06, 0.01]])
    assert too_pure(photo).tolist() == [[False, False, True], [False] * 3, [False] * 3]
    error = residual(photo + 0.04, photo, "linear", clipped=True, pure=too_pure(photo))
    torch.testing.assert_close(error, torch.tensor([[0.04, 0.04, 0], [0.04] * 3, [0.04] * 3]))
    for options in ({"clipped": True}, {"clipped": False, "pure": too_pure(photo)}):
        torch.testing.assert_close(residual(photo + 0.04, photo, "linear", **options), torch.full((3, 3), 0.04))


def test_l1_plus_l2():
    assert float(l1_l2(torch.tensor([1.0, -3.0]))) == pytest.approx(2 + 5)


def test_consistency_is_the_papers_weighted_sum():
    maps = [torch.zeros(4, 3), torch.zeros(4, 1), torch.zeros(4, 1)]
    prior = [torch.full((4, 3), -0.3), torch.full((4, 1), 0.5), torch.full((4, 1), 0.2)]
    assert float(consistency(maps, prior)) == pytest.approx(1.0)
    assert float(consistency(maps, prior, (2.0, 0.0, 10.0))) == pytest.approx(0.6 + 2.0)


def test_log_total_variation_equals_a_loop():
    log_map = torch.randn(4, 8, 3, generator=torch.Generator().manual_seed(0))
    down = [abs(float(log_map[i + 1, j, c] - log_map[i, j, c])) for i in range(3) for j in range(8) for c in range(3)]
    right = [
        abs(float(log_map[i, (j + 1) % 8, c] - log_map[i, j, c])) for i in range(4) for j in range(8) for c in range(3)
    ]
    assert float(log_total_variation(log_map)) == pytest.approx(np.mean(down) + np.mean(right), rel=1e-5)


def test_weighted_variation_takes_the_heavier_texel_of_each_pair():
    log_map = torch.randn(3, 6, 3, generator=torch.Generator().manual_seed(2))
    weight = 1 + torch.rand(3, 6, generator=torch.Generator().manual_seed(3))

    def price(a: tuple[int, int], b: tuple[int, int]) -> float:
        return float((log_map[a] - log_map[b]).abs().mean() * max(weight[a], weight[b]))

    down = [price((i + 1, j), (i, j)) for i in range(2) for j in range(6)]
    right = [price((i, (j + 1) % 6), (i, j)) for i in range(3) for j in range(6)]
    assert float(log_total_variation(log_map, weight)) == pytest.approx(np.mean(down) + np.mean(right), rel=1e-5)
    assert float(log_total_variation(log_map, torch.ones(3, 6))) == pytest.approx(float(log_total_variation(log_map)))


def test_grey_has_no_chroma():
    grey = torch.randn(4, 8, 1, generator=torch.Generator().manual_seed(1)).expand(4, 8, 3)
    assert float(log_chroma(grey)) == pytest.approx(0, abs=1e-7)
    assert float(log_chroma(torch.tensor([[[3.0, 0.0, 0.0]]]))) == pytest.approx((2 + 1 + 1) / 3)
