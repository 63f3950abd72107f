"""What the optimiser moves: encodings, continuity, starting points and shapes."""

import math

import cv2
import numpy as np
import pytest
import torch

from materialist.envmap import row_solid_angle, sh_basis, texel_directions
from materialist.fit.fields import (
    EnvmapMLP,
    MaterialMaps,
    MaterialMLP,
    MaterialUNet,
    clamped,
    positional_encoding,
    resize_envmap,
)


def prior_maps(count: int, seed: int = 0):
    """[P, 5] in [0.1, 0.9]."""
    return 0.1 + 0.8 * torch.rand(count, 5, generator=torch.Generator().manual_seed(seed))


def test_positional_encoding_is_sines_then_cosines():
    x = torch.tensor([[0.25, -0.5]])
    expected = [math.sin(2**k * math.pi * v) for k in range(3) for v in (0.25, -0.5)]
    expected += [math.cos(2**k * math.pi * v) for k in range(3) for v in (0.25, -0.5)]
    torch.testing.assert_close(positional_encoding(x, 3), torch.tensor([expected]))


def seam(envmap) -> float:
    """How much larger the step from the last column to the first is than the largest step between columns."""
    steps = (envmap[:, 1:] - envmap[:, :-1]).abs().max()
    return float((envmap[:, 0] - envmap[:, -1]).abs().max() / steps)


def test_direction_field_is_continuous_where_the_map_is_sewn():
    torch.manual_seed(3)
    sphere = EnvmapMLP()
    sheet = EnvmapMLP(coordinates="uv")
    assert sphere.net[0].in_features == 2 * 4 * 3 and sheet.net[0].in_features == 2 * 4 * 2
    with torch.no_grad():
        envmap = sphere(48)
        flat = sheet(48)
    assert envmap.shape == (48, 96, 3)
    assert float(envmap.min()) >= 0
    assert seam(envmap) < 1.2
    # Near a pole all columns look nearly the same way; on the sheet they do not.
    assert float(envmap[0].std(0).max()) < 0.8 * float(flat[0].std(0).max())


def test_spherical_harmonics_are_orthonormal_and_the_known_ones():
    d = texel_directions(128, 256)
    basis = sh_basis(d, 3)
    weight = np.broadcast_to(row_solid_angle(128)[:, None], d.shape[:2])
    gram = np.einsum("ijk,ijl,ij->kl", basis, basis, weight)
    np.testing.assert_allclose(gram, np.eye(16), atol=2e-3)
    c1 = math.sqrt(3 / (4 * math.pi))
    c2 = math.sqrt(5 / (16 * math.pi))
    np.testing.assert_allclose(basis[..., 0], math.sqrt(1 / (4 * math.pi)), rtol=1e-5)
    np.testing.assert_allclose(basis[..., 2], c1 * d[..., 1], atol=1e-5)
    for column, axis in ((1, 0), (3, 2)):  # the sign is a convention
        np.testing.assert_allclose(np.abs(basis[..., column]), c1 * np.abs(d[..., axis]), atol=1e-5)
    np.testing.assert_allclose(basis[..., 6], c2 * (3 * d[..., 1] ** 2 - 1), atol=1e-5)


@pytest.mark.parametrize("height", [4, 8, 10, 12, 13, 16, 32, 48, 80])
def test_resizing_keeps_the_mean_and_shrinking_the_light_of_every_texel(height):
    """By any ratio: an average of windows that overlap loses a small sun, or doubles it."""
    envmap = torch.rand(16, 32, 3, generator=torch.Generator().manual_seed(0))
    resized = resize_envmap(envmap, height)
    assert resized.shape == (height, 2 * height, 3)
    torch.testing.assert_close(resized.mean((0, 1)), envmap.mean((0, 1)), rtol=0.01, atol=0.01)
    assert float(resized.min()) >= float(envmap.min()) and float(resized.max()) <= float(
        envmap.max()
    )
    for row, column in ((7, 3), (8, 16), (6, 31)) if height < 16 else ():
        envmap = torch.zeros(16, 32, 3)
        envmap[row, column] = 100
        small = resize_envmap(envmap, height)
        assert float(small.sum()) * 16 * 32 / (2 * height**2) == pytest.approx(300 * 1, rel=1e-4)
        means = cv2.resize(envmap.numpy(), (2 * height, height), interpolation=cv2.INTER_AREA)
        np.testing.assert_allclose(small.numpy(), means, atol=1e-3)


def test_material_network_starts_exactly_at_the_prior():
    prior = prior_maps(40)
    pixels = torch.arange(40)
    assert MaterialMLP(prior, pixels, 4, 10)().equal(prior)
    assert MaterialMaps(prior)().equal(prior)
    # ... and both its weights and zeta have somewhere to go.
    field = MaterialMLP(prior, pixels, 4, 10)
    torch.nn.init.normal_(field.last.weight, std=0.01, generator=torch.Generator().manual_seed(0))
    change = (field() - prior).abs()
    assert 0 < float(change.detach().max()) <= float(field.zeta.detach()) + 1e-6
    assert field.zeta.requires_grad


def test_material_network_tells_equal_priors_apart_by_their_place():
    """At any size: the places are those of a picture of 512 pixels."""
    field = MaterialMLP(torch.full((64, 5), 0.5), torch.arange(64), 8, 8)
    torch.nn.init.normal_(field.last.weight, std=0.01, generator=torch.Generator().manual_seed(0))
    assert float(field().detach().std(0).min()) > 0.01
    assert float(field.code[:, :2].max()) == 7 * 64


@pytest.mark.parametrize("kind", ["mlp", "maps", "unet"])
def test_some_rows_of_a_field_are_those_of_all(kind):
    prior = prior_maps(40)
    pixels = torch.arange(40)
    kinds = {
        "mlp": lambda: MaterialMLP(prior, pixels, 4, 10),
        "maps": lambda: MaterialMaps(prior),
        "unet": lambda: MaterialUNet(prior, pixels, 4, 10),
    }
    field = kinds[kind]()
    rows = torch.tensor([7, 3, 30])
    with torch.no_grad():
        for parameter in field.parameters():
            parameter.add_(0.01)
        torch.testing.assert_close(field(rows), field()[rows])


def test_what_has_left_the_range_can_come_back():
    values = torch.tensor([-0.2, 0.5, 1.3], requires_grad=True)
    inside = clamped(values)
    torch.testing.assert_close(inside.detach(), torch.tensor([0.0, 0.5, 1.0]))
    inside.sum().backward()
    torch.testing.assert_close(values.grad, torch.ones(3))


@pytest.mark.parametrize(("height", "width"), [(8, 8), (7, 10), (5, 13)])
def test_unet_takes_any_size_and_starts_at_the_prior(height, width):
    pixels = torch.arange(height * width)[::2]
    prior = prior_maps(len(pixels))
    field = MaterialUNet(prior, pixels, height, width, channels=4)
    assert field().shape == (len(pixels), 5)
    torch.testing.assert_close(field(), prior)
    field().square().sum().backward()
    assert any(p.grad is not None and p.grad.abs().max() > 0 for p in field.parameters())
