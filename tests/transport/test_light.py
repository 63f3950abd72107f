"""The light matrix against gathering and shading, pixel by pixel; its two kinds of rays estimate each lobe together."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from transport_scenes import furnished_room, windowed_sky

from materialist.transport.cache import CacheSettings, TransportCache
from materialist.transport.light import light_matrix
from materialist.transport.shading import shade

HEIGHT = 16


@pytest.fixture(scope="module")
def both():
    """A cache with many samples, the rows compared, their materials, and the matrix of these rows."""
    camera, geometry, materials = furnished_room(48)
    cache = TransportCache(geometry, camera, CacheSettings(256, 128))
    rows = np.arange(3, len(cache.pixels), 7)
    return cache, rows, materials, light_matrix(cache, materials, rows, HEIGHT)


def shaded(both, envmap, radiance):
    cache, rows, materials, _ = both
    pixels = cache.pixels
    a, r, m = (
        torch.from_numpy(x.reshape(materials.roughness.size, -1)[pixels])
        for x in (materials.albedo, materials.roughness, materials.metallic)
    )
    return shade(cache.gather(envmap, radiance), a, r[:, 0], m[:, 0])[rows]


def relative_error(a, b):
    return float((a - b).norm() / b.norm())


def test_matrix_times_light_is_gather_and_shade(both):
    envmap = windowed_sky(HEIGHT)
    matrix = both[3]
    direct = matrix.combine(matrix.direct(torch.from_numpy(envmap).reshape(-1, 3)))
    reference = shaded(both, envmap, None)
    assert relative_error(direct, reference) < 0.02
    assert float(direct.mean() / reference.mean()) == pytest.approx(1, abs=0.006)
    # The comparison can fail: a light turned by a quarter is far outside it.
    turned = torch.from_numpy(np.roll(envmap, HEIGHT // 2, 1)).reshape(-1, 3)
    assert relative_error(matrix.combine(matrix.direct(turned)), reference) > 0.1


def test_matrix_sums_what_surfaces_send(both):
    cache, _, materials, matrix = both
    radiance = (
        materials.albedo
        * np.linspace(0.2, 2, materials.albedo.shape[1], dtype=np.float32)[None, :, None]
    )
    black = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    indirect = matrix.combine(matrix.indirect(torch.from_numpy(cache.slot_radiance(radiance))))
    reference = shaded(both, black, radiance)
    assert relative_error(indirect, reference) < 0.04
    assert float(indirect.mean() / reference.mean()) == pytest.approx(1, abs=0.01)


def test_direct_light_is_linear_and_differentiable(both):
    matrix = both[3]
    rng = torch.Generator().manual_seed(0)
    a, b = (torch.rand(2 * HEIGHT**2, 3, generator=rng) for _ in range(2))
    torch.testing.assert_close(
        matrix.direct(2 * a + b), 2 * matrix.direct(a) + matrix.direct(b), rtol=1e-4, atol=1e-5
    )
    envmap = a.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(matrix.direct(envmap)[0, 5, 1], envmap)
    torch.testing.assert_close(gradient[:, 1], matrix.parts[0][5])
    assert not gradient[:, [0, 2]].any()
    weight = torch.rand(matrix.direct(a).shape, generator=rng)
    (gradient,) = torch.autograd.grad((weight * matrix.direct(envmap)).sum(), envmap)
    torch.testing.assert_close(gradient, torch.einsum("lqt,lqc->tc", matrix.parts, weight))


@pytest.mark.parametrize("change", [{"albedo": 0.5}, {"metallic": 1.0}, {"metallic": 0.0}])
def test_other_materials_give_their_own_light(both, change):
    """What the albedo multiplies holds it right: A (1 - M) f_d + (0.04 (1 - M) + M A) f_0 + f_1."""
    cache, rows, materials, matrix = both
    other = {k: np.full_like(getattr(materials, k), v) for k, v in change.items()}
    changed = replace(materials, **other)
    envmap = windowed_sky(HEIGHT)
    flat = torch.from_numpy(envmap).reshape(-1, 3)
    again = light_matrix(cache, changed, rows, HEIGHT)
    found = again.combine(again.direct(flat))
    reference = shaded((cache, rows, changed, None), envmap, None)
    assert (
        relative_error(found, reference) < 0.035
    )  # of metals, gathering interpolates between roughness levels
    assert relative_error(matrix.combine(matrix.direct(flat)), reference) > 0.05


@pytest.fixture(scope="module")
def scene():
    """A cache with few samples, its materials, and rows."""
    camera, geometry, materials = furnished_room(48)
    cache = TransportCache(geometry, camera, CacheSettings(4, 4))
    return cache, materials, np.arange(3, len(cache.pixels), 7)


def lit(scene, metallic=None, roughness=None, **samples):
    """The light of every third of the rows: the noise of a row is the same for any number of them."""
    cache, materials, rows = scene
    rows = rows[::3]
    given = {"metallic": metallic, "roughness": roughness}
    other = {k: np.full_like(materials.metallic, v) for k, v in given.items() if v is not None}
    matrix = light_matrix(cache, replace(materials, **other), rows, HEIGHT, **samples)
    return matrix.combine(matrix.direct(torch.from_numpy(windowed_sky(HEIGHT)).reshape(-1, 3)))


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_few_rays_are_near_many(scene, metallic):
    many = lit(scene, metallic, sphere_samples=16384, specular_samples=4096)
    assert relative_error(lit(scene, metallic), many) < 0.015


@pytest.mark.parametrize("roughness", [0.25, pytest.param(0.4, marks=pytest.mark.slow), 0.9])
def test_either_kind_alone_estimates_metals(scene, roughness):
    """Balanced, the shares of the kinds do not matter to the mean."""
    texels = lit(scene, 1.0, roughness, sphere_samples=32768, specular_samples=1)
    normals = lit(scene, 1.0, roughness, sphere_samples=512, specular_samples=4096)
    assert relative_error(texels, normals) < 0.02
    assert float(texels.mean() / normals.mean()) == pytest.approx(1, abs=0.005)


def test_a_low_light_of_one_texel_reaches_all_pixels_that_see_it(scene):
    """What cosine-weighted rays seldom meet."""
    cache, materials, rows = scene
    matt = replace(materials, metallic=0 * materials.metallic)
    matrix, many = (
        light_matrix(cache, matt, rows, HEIGHT, **k) for k in ({}, {"sphere_samples": 32768})
    )
    compared = 0
    for column in range(0, 2 * HEIGHT, 5):
        light = torch.zeros(HEIGHT, 2 * HEIGHT, 3)
        light[HEIGHT // 2 - 1, column] = 100
        found, true = (m.combine(m.direct(light.reshape(-1, 3))) for m in (matrix, many))
        if float(true.mean()) > 1e-3:
            compared += 1
            assert relative_error(found, true) < 0.25
    assert compared >= 3
