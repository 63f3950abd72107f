"""The formulas of the package against the reference, in each library; sampling by moments."""

import disney_reference as reference
import numpy as np
import pytest
import surfaces
import torch
from surfaces import mi

from materialist.bsdf import disney, ggx, lobes

UP = np.array([0.0, 0.0, 1.0])
LIBRARIES = {
    "numpy": (np.asarray, np.asarray),
    "torch": (torch.from_numpy, np.asarray),
    "drjit": (lambda x: mi.Float(np.asarray(x, np.float32)), np.array),
}
"""Name -> (to the library, and back)."""


def directions(count, seed):
    """[N, 3] float64 unit directions of the upper hemisphere."""
    d = surfaces.directions(count, seed).astype(float)
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("name", LIBRARIES)
def test_formulas_agree_with_the_reference(name):
    there, back = LIBRARIES[name]
    rng = np.random.default_rng(1)
    wi, wo, rough, metal, albedo = (
        directions(500, 0),
        directions(500, 1),
        *rng.uniform(0.1, 1, (3, 500)),
    )

    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    cos_d = (h * wi).sum(1)
    alpha, sin2, cos_i, cos_o = (
        there(x) for x in (rough**2, h[:, 0] ** 2 + h[:, 1] ** 2, wi[:, 2], wo[:, 2])
    )
    found = disney.diffuse_coefficients(cos_i, cos_o, there(cos_d))

    def close(x, y):
        return np.testing.assert_allclose(back(x), y, rtol=2e-4, atol=1e-6)

    close(
        disney.quadratic(found, there(rough)),
        disney.quadratic(reference.diffuse_coefficients(UP, wi, wo).T, rough),
    )
    shape = ggx.distribution(sin2, alpha) * ggx.smith_g1(cos_i, alpha) * ggx.smith_g1(cos_o, alpha)
    s0, s1 = reference.specular_split(rough, UP, wi, wo)
    close(shape / (4 * cos_i * cos_o) * (1 - disney.schlick_weight(there(cos_d))), s0)
    close(
        disney.half_vector_density(cos_i, sin2, alpha) * ggx.smith_g1(cos_o, alpha) / cos_o, s0 + s1
    )
    base = disney.base_reflectance(there(albedo), there(metal))
    close(base, reference.base_reflectance(albedo[:, None], metal)[:, 0])
    close(disney.fresnel(base, there(cos_d)) * shape / (4 * cos_i * cos_o), back(base) * s0 + s1)
    close(ggx.alpha_of(there(np.array([0.0, 0.5]))), [ggx.MIN_ALPHA, 0.25])
    normal = np.stack(
        [
            back(c)
            for c in ggx.visible_normal([there(c) for c in wi.T], alpha, there(rough), there(metal))
        ]
    )
    again = np.stack(ggx.visible_normal(wi.T, rough**2, rough, metal))
    np.testing.assert_allclose(normal, again, atol=1e-3)


def test_diffuse_polynomial_is_the_products_of_the_paper():
    """pi f_d / A = F_d(wi) F_d(wo), each 1 + (F_D90 - 1)(1 - n.w)^5 with F_D90 = 0.5 + 2 R (h.w)^2."""
    wi = directions(200, 0)
    wo = directions(200, 1)
    rough = np.random.default_rng(2).random(200)
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    f90 = 0.5 + 2 * rough * (h * wi).sum(1) ** 2
    product = np.prod([1 + (f90 - 1) * (1 - w[:, 2]) ** 5 for w in (wi, wo)], axis=0)
    c = reference.diffuse_coefficients(UP, wi, wo)
    np.testing.assert_allclose(
        c @ [1, 0, 0] + c[:, 1] * rough + c[:, 2] * rough**2, product, rtol=1e-12
    )


@pytest.mark.parametrize("alpha", [0.1, 0.4, 1.0])
@pytest.mark.parametrize("cos_o", [0.15, 0.6, 1.0])
def test_visible_normals_have_the_moments_of_their_density(alpha, cos_o):
    """Density D_v(h) = G1(wo) max(0, wo.h) D(h) / cos_o, integrated on a fine grid."""
    sin_o = float(np.sqrt(1 - cos_o**2))
    wo = mi.Vector3f(sin_o, 0, cos_o)
    sampled = np.array(
        lobes.visible_normal_vector(
            wo, mi.Float(alpha), mi.Point2f(*np.random.default_rng(0).random((2, 1 << 16)))
        )
    ).astype(np.float64)
    # tan(theta_h) = alpha tan(t) flattens D: D(h) cos(theta_h) dh = sin(2t) dt dphi / 2 pi. Midpoints in t and phi.
    t, phi = np.meshgrid(
        (np.arange(1000) + 0.5) / 1000 * np.pi / 2, (np.arange(400) + 0.5) / 400 * 2 * np.pi
    )
    z = 1 / np.sqrt(1 + (alpha * np.tan(t)) ** 2)
    h = np.stack([np.sqrt(1 - z**2) * np.cos(phi), np.sqrt(1 - z**2) * np.sin(phi), z])
    flat = np.sin(2 * t) * (np.pi / 2) / t.size
    weight = (
        flat * ggx.smith_g1(cos_o, alpha) * np.maximum(h[0] * sin_o + h[2] * cos_o, 0) / (cos_o * z)
    )
    assert weight.sum() == pytest.approx(
        1, abs=2e-3
    )  # the density is normalised: the formula itself is right
    for moment in (
        lambda v: v[0],
        lambda v: v[2],
        lambda v: v[0] ** 2,
        lambda v: v[1] ** 2,
        lambda v: v[0] * v[2],
    ):
        assert moment(sampled).mean() == pytest.approx((weight * moment(h)).sum(), abs=6e-3)
