"""Losses against closed forms and slow twins."""

import math

import numpy as np
import pytest
import torch

from materialist.camera import pixel_rays
from materialist.types import Camera
from materialist_lab.train import losses


def _random(*shape, seed=0):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def test_means_see_only_the_mask():
    a = torch.zeros(1, 3, 4, 4)
    b = torch.ones(1, 3, 4, 4)
    mask = torch.zeros(1, 1, 4, 4)
    # The right half is far off, and masked out.
    mask[..., :2] = 1
    b[..., 2:] = 99
    assert losses.l1(a, b, mask).item() == 1
    assert losses.l2(a, 2 * b, mask).item() == 4
    assert losses.l1(a, b, 0 * mask).item() == 0


def test_silog_is_the_papers_formula():
    predicted = _random(2, 1, 5, 7) + 0.5
    true = 4 * _random(2, 1, 5, 7, seed=1) + 0.1
    true[0, 0, 0, 0] = 25  # beyond [0, 20]: left out
    mask = torch.ones_like(true)
    # L_D = sqrt(E[g^2] - lambda E[g]^2) with lambda = 1/2.
    kept = (true <= 20).numpy()
    g = (np.log(true.numpy()) - np.log(predicted.numpy()))[kept]
    expected = np.sqrt((g**2).mean() - 0.5 * g.mean() ** 2)
    assert losses.silog(predicted, true, mask).item() == pytest.approx(expected, rel=1e-5)


def test_scale_blind_losses():
    true = _random(2, 3, 8, 8) * 0.4 + 0.1
    mask = torch.ones(2, 1, 8, 8)
    # A factor of its own for each picture.
    factors = torch.tensor([0.6, 1.7]).view(2, 1, 1, 1)
    assert losses.scaled_l1(true * factors, true, mask).item() < 1e-6
    log_depth = _random(2, 1, 8, 8)
    assert losses.centred_l1(log_depth + factors, log_depth, mask).item() < 1e-6
    assert losses.centred_l1(log_depth * 2, log_depth, mask).item() > 0.1


def test_cosine_of_a_known_angle():
    up = torch.tensor([0.0, 1.0, 0.0]).view(1, 3, 1, 1).expand(1, 3, 2, 2)
    # Sixty degrees: cos = 1/2.
    tilted = torch.tensor([0.0, 0.5, 0.75**0.5]).view(1, 3, 1, 1).expand(1, 3, 2, 2)
    assert losses.cosine(up, tilted, torch.ones(1, 1, 2, 2)).item() == pytest.approx(0.5, abs=1e-6)


def test_gradient_loss_of_a_ramp():
    ramp = torch.arange(16.0).view(1, 1, 1, 16).expand(1, 1, 16, 16)
    mask = torch.ones(1, 1, 16, 16)
    # Against a constant, neighbours at scale s differ by 2^s across and 0 down.
    assert losses.gradient(ramp, 0 * ramp, mask, scales=3).item() == pytest.approx((1 + 2 + 4) / 3)
    assert losses.gradient(ramp + 5, ramp, mask).item() == 0


def test_slopes_know_a_plane_from_its_depth():
    camera = Camera(32, 32, 40.0)
    rays = torch.from_numpy(pixel_rays(camera)[..., :2]).permute(2, 0, 1)[None]
    # A plane n . p = -1 in the camera frame: depth = -1 / (n . ray).
    normal = torch.tensor([0.3, 0.5, 0.8]) / np.sqrt(0.98)
    directions = torch.cat([rays, -torch.ones(1, 1, 32, 32)], 1)
    depth = -1 / (directions * normal.view(1, 3, 1, 1)).sum(1, keepdim=True)
    true = normal.view(1, 3, 1, 1).expand(1, 3, 32, 32)
    mask = torch.ones(1, 1, 32, 32)
    assert losses.slopes(depth.log(), rays, true, mask).item() < 1e-3
    # A constant depth has the normal (0, 0, 1).
    flat = torch.zeros(1, 1, 32, 32)
    assert losses.slopes(flat, rays, true, mask).item() == pytest.approx(
        1 - 0.8 / np.sqrt(0.98), abs=0.01
    )


def test_all_losses_have_finite_gradients_at_zero_error():
    true = _random(1, 1, 16, 16) + 0.5
    mask = torch.ones_like(true)
    for loss in (losses.silog, losses.centred_l1, losses.gradient, losses.scaled_l1):
        predicted = true.clone().requires_grad_()
        loss(predicted, true, mask).backward()
        assert torch.isfinite(predicted.grad).all(), loss.__name__


def test_the_loss_of_the_light_is_that_of_the_weighted_directions():
    """A map of radiance 2 above and 1 below, of which only the upper half counts."""
    true = torch.ones(1, 4, 8, 16)
    true[:, :3, :4] = 2
    true[:, 3, 4:] = 0
    predicted = torch.zeros(1, 4, 8, 16)
    # Right where it counts; scale 1, whose logarithm is 0.
    predicted[:, :3] = np.log(2)
    likelihood, irradiance = losses.light(predicted, true)
    assert likelihood.item() == pytest.approx(0, abs=1e-6) and irradiance.item() == pytest.approx(
        0, abs=1e-6
    )
    # Half as bright again: an error of log 1.5 everywhere.
    predicted[:, :3] += np.log(1.5)
    likelihood, irradiance = losses.light(predicted, true)
    assert likelihood.item() == pytest.approx(np.log(1.5), rel=1e-5)
    assert irradiance.item() == pytest.approx(
        0.5, rel=1e-5
    )  # half as much again in every coefficient
    predicted[:, 3] = np.log(np.log(1.5))  # the scale that fits the error best
    assert losses.light(predicted, true)[0].item() == pytest.approx(
        1 + np.log(np.log(1.5)), rel=1e-5
    )
    both = losses.light(predicted.expand(2, -1, -1, -1), torch.cat([true, 0 * true]))
    assert both[1].item() == pytest.approx(0.5, rel=1e-5), (
        "a light that is not known does not count"
    )


def test_the_likeliest_scale_is_the_mean_error():
    error = torch.tensor([0.1, 0.2, 0.6]).view(1, 1, 1, 3)
    mask = torch.ones_like(error)

    def loss(scale):
        return float(losses.laplace(error, torch.full_like(error, math.log(scale)), mask))

    assert loss(0.3) < min(loss(0.29), loss(0.31))


def test_errors_of_maps_are_those_of_their_spread():
    truth = {name: torch.full((1, 1, 2, 2), 0.5) for name in ("roughness", "metallic", "depth")}
    truth["albedo"] = torch.full((1, 3, 2, 2), 0.5)
    truth["normal"] = torch.tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1).expand(1, 3, 2, 2)
    predicted = {**truth, "depth": truth["depth"] + 3}  # its scale is not known
    predicted["albedo"] = truth["albedo"] + torch.tensor([0.3, 0.0, 0.0]).view(1, 3, 1, 1)
    predicted["roughness"] = truth["roughness"] - 0.2
    predicted["normal"] = torch.tensor([1.0, 0.0, 1.0]).view(1, 3, 1, 1).expand(1, 3, 2, 2)
    errors = losses.absolute_errors(predicted, truth, torch.ones(1, 1, 2, 2))
    expected = torch.tensor([0.1, 0.2, 0.0, math.pi / 4, 0.0])
    torch.testing.assert_close(errors.mean((0, 2, 3)), expected)
