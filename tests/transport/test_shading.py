"""Shading from tables against a loop over pixels, and its gradients against finite differences."""

import numpy as np
import pytest
import torch

from materialist.transport.cache import ROUGHNESS_LEVELS, Tables, levels_around
from materialist.transport.shading import at_roughness, shade, specular_at

P = 6


@pytest.fixture
def tables():
    generator = torch.Generator().manual_seed(3)

    def draw(*shape):
        return torch.rand(*shape, generator=generator, dtype=torch.float64)

    return Tables(draw(P, 9), draw(len(ROUGHNESS_LEVELS), P, 6))


def draw_materials():
    generator = torch.Generator().manual_seed(4)
    albedo = torch.rand(P, 3, generator=generator, dtype=torch.float64)
    roughness = torch.tensor([0.05, 0.15, 0.25, 0.5, 0.77, 0.95], dtype=torch.float64)
    return albedo, roughness, torch.rand(P, generator=generator, dtype=torch.float64)


def slow_twin(tables, albedo, roughness, metallic):
    """A (1 - M) (D0 + D1 R + D2 R^2) + C_0 S0(R) + S1(R), a pixel and a channel at a time."""
    out = np.zeros((P, 3))
    for p in range(P):
        r = float(roughness[p])
        m = float(metallic[p])
        for c in range(3):
            d = [float(tables.diffuse[p, 3 * k + c]) for k in range(3)]
            s = [
                np.interp(r, ROUGHNESS_LEVELS, tables.specular[:, p, 3 * k + c].numpy())
                for k in range(2)
            ]
            a = float(albedo[p, c])
            base = 0.04 * (1 - m) + m * a
            out[p, c] = a * (1 - m) * (d[0] + d[1] * r + d[2] * r * r) + base * s[0] + s[1]
    return out


def test_shading_equals_the_slow_twin(tables):
    materials = draw_materials()
    np.testing.assert_allclose(
        shade(tables, *materials).numpy(), slow_twin(tables, *materials), rtol=1e-7
    )


@pytest.mark.parametrize("roughness", [0.0, 0.03, 1.0])
def test_roughness_beyond_the_levels_is_held(tables, roughness):
    level = 0 if roughness < 0.5 else -1
    at = specular_at(tables, torch.full((P,), roughness, dtype=torch.float64))
    torch.testing.assert_close(at, tables.specular[level])


def test_gradients_are_those_of_finite_differences(tables):
    leaves = [x.clone().requires_grad_() for x in draw_materials()]
    assert torch.autograd.gradcheck(lambda *m: shade(tables, *m), leaves, eps=1e-6, atol=1e-6)


def test_the_levels_around_a_roughness_are_all_that_shading_takes(tables):
    albedo, _, metallic = draw_materials()
    roughness = np.array([0.2, 0.25, 0.3, 0.35, 0.41, 0.42])
    some = levels_around(roughness)
    assert [ROUGHNESS_LEVELS[k] for k in some] == [0.12, 0.2, 0.3, 0.42]
    few = Tables(
        tables.diffuse,
        tables.specular[some.start : some.stop],
        tables.levels[some.start : some.stop],
    )
    materials = albedo, torch.from_numpy(roughness), metallic
    expected = shade(tables, *materials)
    torch.testing.assert_close(shade(few, *materials), expected)
    # At their own roughness alone, they need one level.
    own = at_roughness(few, roughness)
    assert len(own.specular) == 1
    torch.testing.assert_close(shade(own, *materials), expected)


@pytest.mark.parametrize(
    ("roughness", "first", "count"), [([0.0], 0, 2), ([1.0], 6, 2), ([0.0, 1.0], 0, 8), ([], 0, 2)]
)
def test_there_are_two_levels_around_any_roughness(roughness, first, count):
    levels = levels_around(np.array(roughness))
    assert levels.start == first and len(levels) == count
