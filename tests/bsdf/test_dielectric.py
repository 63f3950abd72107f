"""Snell, Fresnel and rough surfaces, against closed forms."""

import numpy as np
import pytest
from disney_reference import hemisphere

from materialist.bsdf.dielectric import fresnel_dielectric, masking, reflect, refract, visible_facet

RNG = np.random.default_rng(5)


def unit(shape):
    v = RNG.normal(size=(*shape, 3))
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def pairs(count=500):
    """Directions and normals that point against them."""
    d = unit((count,))
    n = unit((count,))
    return d, np.where(np.sum(d * n, -1, keepdims=True) > 0, -n, n)


@pytest.mark.parametrize("ior", [1.0, 1.1, 1.5, 2.4])
def test_snells_law(ior):
    d, n = pairs()
    t, is_total = refract(d, n, ior)
    assert not is_total.any()
    sine_in, sine_out = (np.linalg.norm(np.cross(n, v), axis=-1) for v in (d, t))
    np.testing.assert_allclose(sine_in, ior * sine_out, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(t, axis=-1), 1, atol=1e-12)
    assert (np.sum(t * n, -1) <= 1e-12).all()
    np.testing.assert_allclose(
        np.sum(np.cross(d, n) * t, -1), 0, atol=1e-12
    )  # stays in the plane of incidence


def test_refraction_is_reversible():
    d, n = pairs()
    inside, _ = refract(d, n, 1.5)
    back, is_total = refract(-inside, -n, 1 / 1.5)
    assert not is_total.any()
    np.testing.assert_allclose(back, -d, atol=1e-9)


def test_reflection_is_total_beyond_the_critical_angle():
    critical = np.arcsin(1 / 1.5)
    angle = np.array([critical - 1e-4, critical + 1e-4, 1.5])
    d = np.stack([np.sin(angle), 0 * angle, -np.cos(angle)], -1)
    n = np.tile([0.0, 0, 1], (3, 1))
    t, is_total = refract(d, n, 1 / 1.5)
    assert is_total.tolist() == [False, True, True]
    np.testing.assert_allclose(t[1:], reflect(d, n)[1:])
    assert fresnel_dielectric(np.cos(angle), 1 / 1.5).tolist()[1:] == [1, 1]


def test_fresnel_at_known_angles():
    assert fresnel_dielectric(np.array(1.0), 1.5) == pytest.approx(0.04)
    assert fresnel_dielectric(np.array(0.0), 1.5) == 1
    brewster = np.cos(np.arctan(1.5))  # only light across the plane of incidence is reflected
    sine = np.sin(np.arctan(1.5) - np.arctan(1 / 1.5))
    assert fresnel_dielectric(np.array(brewster), 1.5) == pytest.approx(0.5 * sine**2)
    assert (fresnel_dielectric(np.linspace(0.01, 1, 9), 1.0) < 1e-12).all()


def test_fresnel_is_the_same_from_both_sides():
    cosine = np.linspace(0.05, 1, 30)
    inner = np.sqrt(1 - (1 - cosine**2) / 1.7**2)
    np.testing.assert_allclose(
        fresnel_dielectric(cosine, 1.7), fresnel_dielectric(inner, 1 / 1.7), atol=1e-12
    )


def test_facets_are_distributed_as_visible_normals():
    # The mean over visible facets of any f is the integral of f D G1 max(v.h, 0) / (v.n): try f = h.n.
    alpha = 0.4
    cosine = 0.6
    v = np.array([np.sqrt(1 - cosine**2), 0, cosine])
    h = hemisphere(400)
    ggx = alpha**2 / (np.pi * (h[..., 2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    density = ggx * masking(v, np.array([0, 0, 1.0]), alpha) * np.maximum(h @ v, 0) / cosine
    area = 2 * np.pi / density.size
    assert (density * area).sum() == pytest.approx(1, abs=2e-3)
    expected = (density * area * h[..., 2]).sum()
    drawn = [
        visible_facet(
            -v, np.array([0, 0, 1.0]), alpha, (k * 0.7548776662) % 1, (k * 0.5698402910) % 1
        )[2]
        for k in range(4000)
    ]
    assert np.mean(drawn) == pytest.approx(expected, abs=3e-3)
