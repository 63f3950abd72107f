"""The numpy reference against values and laws that follow from the paper's formulas."""

import numpy as np
import pytest

from materialist.bsdf import disney as brdf

UP = np.array([0.0, 0.0, 1.0])


def directions(count: int, seed: int):
    d = np.random.default_rng(seed).normal(size=(count, 3))
    d[:, 2] = np.abs(d[:, 2])
    return d / np.linalg.norm(d, axis=1, keepdims=True)


def test_normal_incidence_by_hand():
    """At wi = wo = n: F_d = 1, h = n, D = 1 / (pi alpha^2), G = 1, F_s = C_0."""
    value = brdf.evaluate(np.array([0.8, 0.4, 0.1]), 0.5, 0.25, UP, UP, UP)
    c0 = 0.04 * 0.75 + 0.25 * np.array([0.8, 0.4, 0.1])
    expected = c0 / (np.pi * 0.25**2) / 4 + 0.75 * np.array([0.8, 0.4, 0.1]) / np.pi
    np.testing.assert_allclose(value, expected, rtol=1e-12)


def test_dielectric_reflectance():
    assert pytest.approx(0.04) == brdf.DIELECTRIC_R0


def test_diffuse_polynomial_is_the_products_of_the_paper():
    """pi f_d / A = F_d(wi) F_d(wo), each 1 + (F_D90 - 1)(1 - n.w)^5 with F_D90 = 0.5 + 2 R (h.w)^2."""
    wi, wo, rough = directions(200, 0), directions(200, 1), np.random.default_rng(2).random(200)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    f90 = 0.5 + 2 * rough * (h * wi).sum(1) ** 2
    product = np.prod([1 + (f90 - 1) * (1 - w[:, 2]) ** 5 for w in (wi, wo)], axis=0)
    c = brdf.diffuse_coefficients(UP, wi, wo)
    np.testing.assert_allclose(c @ [1, 0, 0] + c[:, 1] * rough + c[:, 2] * rough**2, product, rtol=1e-12)


@pytest.mark.parametrize("rough", [0.1, 0.4, 1.0])
def test_specular_split_is_affine_in_its_base(rough):
    """With albedo 1 and metallic 1, C_0 = 1 and F_s = 1: D G / (4 cos cos) = s0 + s1."""
    wi, wo = directions(100, 3), directions(100, 4)
    s0, s1 = brdf.specular_split(rough, UP, wi, wo)
    white = brdf.evaluate(np.ones(3), rough, 1.0, UP, wi, wo)[:, 0]
    np.testing.assert_allclose(s0 + s1, white, rtol=1e-12)
    black = brdf.evaluate(np.zeros(3), rough, 1.0, UP, wi, wo)[:, 0]
    np.testing.assert_allclose(s1, black, rtol=1e-12)


def test_reciprocity_and_frame():
    wi, wo = directions(100, 5), directions(100, 6)
    args = (np.array([0.7, 0.5, 0.2]), 0.3, 0.5)
    there, back = brdf.evaluate(*args, UP, wi, wo), brdf.evaluate(*args, UP, wo, wi)
    np.testing.assert_allclose(there, back, rtol=1e-10)
    turn = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))[0]
    np.testing.assert_allclose(brdf.evaluate(*args, turn @ UP, wi @ turn.T, wo @ turn.T), there, rtol=1e-8)


def test_both_sides_shade_alike_and_nothing_passes_through():
    wi, wo = directions(50, 8), directions(50, 9)
    args = (np.array([0.7, 0.5, 0.2]), 0.3, 0.5)
    np.testing.assert_allclose(brdf.evaluate(*args, UP, -wi, -wo), brdf.evaluate(*args, UP, wi, wo), rtol=1e-12)
    assert not brdf.evaluate(*args, UP, wi, -wo).any()


@pytest.mark.parametrize("rough", [0.2, 0.5, 1.0])
def test_distribution_of_normals_is_normalised(rough):
    """The integral of D cos over the hemisphere is 1: at wi = wo, h = wi and f_s = D G1^2 / (4 cos^2) for C_0 = 1."""
    cosine = (np.arange(20000) + 0.5) / 20000
    w = np.stack([np.sqrt(1 - cosine**2), 0 * cosine, cosine], 1)
    s0, s1 = brdf.specular_split(rough, UP, w, w)
    alpha = rough**2
    g1 = 2 / (1 + np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)))
    distribution = (s0 + s1) * 4 * cosine**2 / g1**2
    assert 2 * np.pi * (distribution * cosine).mean() == pytest.approx(1, abs=2e-3)


def test_roughness_below_the_clamp_changes_nothing():
    wi, wo = directions(20, 10), directions(20, 11)
    low, clamp = (brdf.specular_split(r, UP, wi, wo)[0] for r in (0.0, np.sqrt(brdf.MIN_ALPHA)))
    np.testing.assert_allclose(low, clamp, rtol=1e-12)
