"""Directions and the two closed forms of the BRDF against numpy, and their densities by moments."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from materialist.bsdf.disney import diffuse_coefficients
from materialist.transport import sampling

N = 1 << 14


@pytest.fixture(scope="module")
def lattice():
    return sampling.point(dr.arange(mi.UInt32, N), dr.opaque(mi.UInt32, N), mi.Point2f(0.2, 0.7))


def test_points_fill_the_square(lattice):
    """Every cell of a 64 x 64 grid holds 4 points, give or take one a side: far more even than random."""
    x, y = np.array(lattice)
    assert x.min() >= 0 and y.min() >= 0 and x.max() < 1 and y.max() < 1
    counts, _, _ = np.histogram2d(x, y, bins=64, range=[[0, 1], [0, 1]])
    assert counts.min() >= 2 and counts.max() <= 6


def test_shift_is_stratified_over_a_tile_and_repeats_with_the_seed():
    shift = sampling.pixel_shift(9, 13, 5)
    assert shift.shape == (9, 13, 2)
    tile = shift[:4, :4].reshape(-1, 2)
    assert len(np.unique(tile[:, 0])) == 16
    cells = (tile * 2).astype(int)  # a quarter of the points in each quarter of the square, give or take one
    counts = np.bincount(cells[:, 0] * 2 + cells[:, 1], minlength=4)
    assert counts.min() >= 3 and counts.max() <= 5
    np.testing.assert_array_equal(shift, sampling.pixel_shift(9, 13, 5))
    assert not np.array_equal(shift, sampling.pixel_shift(9, 13, 6))


def test_cosine_directions_have_the_moments_of_cos_over_pi(lattice):
    x, y, z = np.array(sampling.cosine_direction(lattice)).astype(np.float64)
    np.testing.assert_allclose(x**2 + y**2 + z**2, 1, atol=1e-5)
    assert z.min() >= 0
    # Integrals of cos/pi z^k over the hemisphere: 2 / (k + 2).
    for k in (1, 2, 4):
        assert (z**k).mean() == pytest.approx(2 / (k + 2), abs=2e-3)
    assert abs(x.mean()) < 2e-3 and abs((x * y).mean()) < 2e-3
    assert (x**2).mean() == pytest.approx(1 / 4, abs=2e-3)


@pytest.mark.parametrize("alpha", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("cos_o", [0.15, 0.6, 1.0])
def test_visible_normals_have_the_moments_of_their_density(lattice, alpha, cos_o):
    """Density D_v(h) = G1(wo) max(0, wo.h) D(h) / cos_o, integrated on a fine grid."""
    sin_o = float(np.sqrt(1 - cos_o**2))
    wo = mi.Vector3f(sin_o, 0, cos_o)
    sampled = np.array(sampling.visible_normal(wo, mi.Float(alpha), lattice)).astype(np.float64)
    # tan(theta_h) = alpha tan(t) flattens D: D(h) cos(theta_h) dh = sin(2t) dt dphi / 2 pi. Midpoints in t and phi.
    t, phi = np.meshgrid((np.arange(1000) + 0.5) / 1000 * np.pi / 2, (np.arange(400) + 0.5) / 400 * 2 * np.pi)
    z = 1 / np.sqrt(1 + (alpha * np.tan(t)) ** 2)
    h = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    flat = np.sin(2 * t) * (np.pi / 2) / t.size
    weight = flat * _smith(cos_o, alpha) * np.maximum(h[0] * sin_o + h[2] * cos_o, 0) / (cos_o * z)
    assert weight.sum() == pytest.approx(1, abs=2e-3)  # the density is normalised: the formula itself is right
    for moment in (lambda v: v[0], lambda v: v[2], lambda v: v[0] ** 2, lambda v: v[1] ** 2, lambda v: v[0] * v[2]):
        assert moment(sampled).mean() == pytest.approx((weight * moment(h)).sum(), abs=6e-3)


@pytest.mark.parametrize("alpha", [0.01, 0.3, 1.0])
def test_smith_masking_is_the_closed_form(alpha):
    cosine = np.linspace(0.01, 1, 50)
    ours = np.array(sampling.smith_g1(mi.Float(cosine.astype(np.float32)), mi.Float(alpha)))
    np.testing.assert_allclose(ours, _smith(cosine, alpha), rtol=2e-5)
    assert np.array(sampling.smith_g1(mi.Float([-0.3, 0.0]), mi.Float(alpha))).max() == 0


def test_schlick_is_the_fifth_power():
    cosine = np.linspace(-0.2, 1, 30, dtype=np.float32)
    np.testing.assert_allclose(
        np.array(sampling.schlick(mi.Float(cosine))), np.clip(1 - cosine.astype(np.float64), 0, 1) ** 5, atol=1e-6
    )


def test_diffuse_polynomial_is_the_papers_product():
    """F_d(wi) F_d(wo) evaluated directly, F_D90 = 0.5 + 2 R (h.wi)^2 (paper, Preliminary)."""
    rng = np.random.default_rng(0)
    wi, wo = _hemisphere(rng, 500), _hemisphere(rng, 500)
    rough = rng.random(500)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=-1, keepdims=True)
    f90 = 0.5 + 2 * rough * (h * wi).sum(-1) ** 2
    direct = np.prod([1 + (f90 - 1) * (1 - w[:, 2]) ** 5 for w in (wi, wo)], axis=0)
    cos_d = (h * wi).sum(-1)
    c = [
        np.array(v)
        for v in sampling.diffuse_polynomial(*(mi.Float(x.astype(np.float32)) for x in (wi[:, 2], wo[:, 2], cos_d)))
    ]
    np.testing.assert_allclose(c[0] + c[1] * rough + c[2] * rough**2, direct, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(np.stack(c, -1), diffuse_coefficients(np.array([0, 0, 1.0]), wi, wo), atol=1e-5)


def _smith(cosine, alpha):
    tan2 = (1 - cosine**2) / cosine**2
    return 2 / (1 + np.sqrt(1 + alpha**2 * tan2))


def _hemisphere(rng, n):
    d = rng.standard_normal((n, 3))
    d[:, 2] = np.abs(d[:, 2]) + 0.02
    return d / np.linalg.norm(d, axis=-1, keepdims=True)


def test_a_direction_below_the_face_is_mirrored_at_it():
    face = mi.Vector3f(0, 0.6, 0.8)
    above, below = mi.Vector3f(0, 0, 1), mi.Vector3f(0, -0.8, 0.6 - 0.2)
    np.testing.assert_allclose(np.array(sampling.lifted(above, face)).ravel(), [0, 0, 1])
    d = np.array([0, -0.8, 0.4])
    expected = d - 2 * (d @ [0, 0.6, 0.8]) * np.array([0, 0.6, 0.8])
    np.testing.assert_allclose(np.array(sampling.lifted(below, face)).ravel(), expected, atol=1e-6)
    assert expected @ [0, 0.6, 0.8] > 0
    np.testing.assert_allclose(np.array(sampling.lifted(below, mi.Vector3f(0))).ravel(), d, atol=1e-7)


@pytest.mark.parametrize(("degrees", "believed"), [(0, True), (40, True), (50, False), (90, False)])
def test_a_face_is_believed_that_agrees_with_its_normal(degrees, believed):
    angle = np.radians(degrees)
    for side in (1, -1):  # on the normal's side, whichever way the face's corners turn
        face = mi.Vector3f(0, float(side * np.sin(angle)), float(side * np.cos(angle)))
        found = np.array(sampling.face_towards(face, mi.Vector3f(0, 0, 1))).ravel()
        np.testing.assert_allclose(found, [0, np.sin(angle), np.cos(angle)] if believed else [0, 0, 0], atol=1e-6)
