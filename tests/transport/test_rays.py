"""Rays of the light matrix: their two kinds together estimate each lobe, with little noise."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from transport_scenes import furnished_room, windowed_sky

from materialist.transport.cache import CacheSettings, TransportCache
from materialist.transport.light import light_matrix

HEIGHT = 16


@pytest.fixture(scope="module")
def scene():
    camera, geometry, materials = furnished_room(48)
    cache = TransportCache(geometry, camera, CacheSettings(4, 4))
    return cache, materials, np.arange(3, len(cache.pixels), 7)


def lit(scene, metallic=None, roughness=None, **samples):
    cache, materials, rows = scene
    given = {"metallic": metallic, "roughness": roughness}
    other = {k: np.full_like(materials.metallic, v) for k, v in given.items() if v is not None}
    matrix = light_matrix(cache, replace(materials, **other), rows, HEIGHT, **samples)
    return matrix.combine(matrix.direct(torch.from_numpy(windowed_sky(HEIGHT)).reshape(-1, 3)))


def error(found, true):
    return float((found - true).norm() / true.norm())


@pytest.mark.parametrize("metallic", [0.0, 1.0])
def test_few_rays_are_near_many(scene, metallic):
    many = lit(scene, metallic, sphere_samples=16384, specular_samples=4096)
    assert error(lit(scene, metallic), many) < 0.015


@pytest.mark.parametrize("roughness", [0.25, 0.4, 0.9])
def test_either_kind_alone_estimates_metals(scene, roughness):
    """Balanced, the shares of the kinds do not matter to the mean."""
    texels = lit(scene, 1.0, roughness, sphere_samples=32768, specular_samples=1)
    normals = lit(scene, 1.0, roughness, sphere_samples=512, specular_samples=4096)
    assert error(texels, normals) < 0.02
    assert float(texels.mean() / normals.mean()) == pytest.approx(1, abs=0.005)


def test_a_low_light_of_one_texel_reaches_all_pixels_that_see_it(scene):
    """What cosine-weighted rays seldom meet."""
    cache, materials, rows = scene
    matt = replace(materials, metallic=0 * materials.metallic)
    matrix, many = (light_matrix(cache, matt, rows, HEIGHT, **k) for k in ({}, {"sphere_samples": 32768}))
    compared = 0
    for column in range(0, 2 * HEIGHT, 5):
        light = torch.zeros(HEIGHT, 2 * HEIGHT, 3)
        light[HEIGHT // 2 - 1, column] = 100
        found, true = (m.combine(m.direct(light.reshape(-1, 3))) for m in (matrix, many))
        if float(true.mean()) > 1e-3:
            compared += 1
            assert error(found, true) < 0.25
    assert compared >= 3
