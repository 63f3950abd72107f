"""Losses against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from materialist.color import CLIPPED, linear_to_srgb
from materialist.fit.losses import (
    consistency,
    encode,
    encoded_error,
    log_chroma,
    log_total_variation,
    rendering_loss,
)
from materialist.fit.settings import DEFAULT, PAPER


def test_srgb_encoding_is_the_packages():
    x = np.linspace(0, 1, 200, dtype=np.float32)
    np.testing.assert_allclose(
        encode(torch.from_numpy(x), "srgb").numpy(), linear_to_srgb(x), atol=2e-6
    )


def test_clipped_channels_are_wrong_on_one_side_only():
    photo = torch.tensor([[0.5, CLIPPED, 1.0]])
    brighter = photo + 0.4
    darker = photo - 0.4
    torch.testing.assert_close(
        encoded_error(brighter, photo, "linear", white=CLIPPED), torch.tensor([[0.4, 0, 0]])
    )
    torch.testing.assert_close(
        encoded_error(darker, photo, "linear", white=CLIPPED), torch.full((1, 3), -0.4)
    )
    torch.testing.assert_close(
        encoded_error(brighter, photo, "linear", white=math.inf), torch.full((1, 3), 0.4)
    )


def test_consistency_is_a_weighted_sum():
    """Delta times the mean L1 distances of albedo, roughness and metallic, as in the paper; or encoded squares."""
    prior = torch.full((4, 5), 0.4)
    maps = prior + torch.tensor([0.3, 0.3, 0.3, 0.5, 0.2])
    assert float(consistency(maps, prior, PAPER.materials)) == pytest.approx(0.1 * 1.0)
    weighed = replace(PAPER.materials, delta=1.0, weights=(2.0, 0.0, 10.0))
    assert float(consistency(maps, prior, weighed)) == pytest.approx(0.6 + 2.0)
    settings = replace(DEFAULT.materials, delta=1.0, weights=(2.0, 1.0, 10.0))
    albedo = (linear_to_srgb(np.float64(0.7)) - linear_to_srgb(np.float64(0.4))) ** 2
    assert float(consistency(maps, prior, settings)) == pytest.approx(
        2 * albedo + 0.25 + 0.4, rel=1e-5
    )


def test_losses_of_the_rendering():
    error = torch.tensor([0.05, -0.3])
    assert float(rendering_loss(error, "l1+l2")) == pytest.approx(
        (0.05 + 0.3 + 0.05**2 + 0.3**2) / 2
    )
    assert float(rendering_loss(error, "l2")) == pytest.approx((0.05**2 + 0.3**2) / 2)


def test_balanced_loss_gives_the_square_three_times_the_value_of_the_absolute():
    error = torch.tensor([0.05, -0.3], requires_grad=True)
    loss = rendering_loss(error, "balanced")
    absolute = (0.05 + 0.3) / 2
    assert float(loss.detach()) == pytest.approx(4 * absolute)
    loss.backward()
    weight = 3 * absolute / ((0.05**2 + 0.3**2) / 2)  # held
    expected = [(math.copysign(1, e) + weight * 2 * e) / 2 for e in (0.05, -0.3)]
    torch.testing.assert_close(error.grad, torch.tensor(expected))


def test_log_total_variation_equals_a_loop():
    log_map = torch.randn(4, 8, 3, generator=torch.Generator().manual_seed(0))
    down = [
        abs(float(log_map[i + 1, j, c] - log_map[i, j, c]))
        for i in range(3)
        for j in range(8)
        for c in range(3)
    ]
    right = [
        abs(float(log_map[i, (j + 1) % 8, c] - log_map[i, j, c]))
        for i in range(4)
        for j in range(8)
        for c in range(3)
    ]
    assert float(log_total_variation(log_map)) == pytest.approx(
        np.mean(down) + np.mean(right), rel=1e-5
    )


def test_chroma_is_the_spread_of_the_channels_by_their_share():
    log_map = torch.tensor(
        [[[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], [[2.0, 1.0, 0.0], [-1.0, 2.0, -1.0]]]
    )
    even = torch.ones(2, 2)
    share = torch.tensor([[1.0, 0.0], [2.0, 1.0]])
    assert float(log_chroma(log_map, even)) == pytest.approx((2**0.5 + 6**0.5) / 4, abs=1e-3)
    assert float(log_chroma(log_map, share)) == pytest.approx((2 * 2**0.5 + 6**0.5) / 4, abs=1e-3)
