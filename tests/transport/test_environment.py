"""Lookups in the environment map and its pyramid."""

import mitsuba as mi
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from materialist.envmap import row_solid_angle, texels_around
from materialist.transport.environment import EnvmapPyramid, halve


def random_map(height, seed=0):
    return np.random.default_rng(seed).random((height, 2 * height, 3)).astype(np.float32)


def look(envmap, directions):
    directions = np.asarray(directions, np.float64)
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    d = mi.Vector3f(*(mi.Float(np.ascontiguousarray(unit[:, k], np.float32)) for k in range(3)))
    return np.array(EnvmapPyramid(envmap).lookup(d, mi.UInt32(0), mi.Bool(True))).T


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_lookup_equals_the_shares_of_the_light_matrix(seed):
    """`texels_around` spreads a ray over the texels that `lookup` reads."""
    envmap = random_map(8, seed)
    d = np.random.default_rng(seed).standard_normal((64, 3))
    d /= np.linalg.norm(d, axis=-1, keepdims=True)
    index, share = texels_around(d, (8, 16))
    np.testing.assert_allclose(share.sum(-1), 1, atol=1e-9)
    np.testing.assert_allclose(
        (envmap.reshape(-1, 3)[index] * share[..., None]).sum(1), look(envmap, d), atol=2e-4
    )


def test_halving_keeps_the_mean_radiance_of_the_sphere():
    envmap = random_map(16)

    def mean(e):
        return (e * row_solid_angle(len(e))[:, None, None]).sum((0, 1))

    half = halve(envmap)
    assert half.shape == (8, 16, 3)
    np.testing.assert_allclose(mean(half), mean(envmap), rtol=1e-5)


def test_pyramid_chooses_finer_maps_for_narrower_lobes():
    pyramid = EnvmapPyramid(random_map(64))
    heights = [pyramid.heights[pyramid.level(a)[0]] for a in (1e-9, 0.02, 0.2, 10.0)]
    assert heights[0] == 64
    assert heights == sorted(heights, reverse=True)
    assert heights[-1] == 8
