"""The paper's simplified Disney BRDF (section Preliminary) in float64 numpy, written apart from the package's own.

Choices the paper leaves open (see docs/rendering.md): the Smith term is separable, G = G1(wi) G1(wo), as in Mitsuba;
alpha = R^2 is at least `MIN_ALPHA`, so R below 0.032 shines like 0.032; both sides of a surface shade alike.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

ETA = 1.5
"""Relative index of refraction of the dielectric part."""

DIELECTRIC_R0 = ((ETA - 1) / (ETA + 1)) ** 2
"""R_0(eta): Fresnel reflectance at normal incidence, 0.04."""

MIN_ALPHA = 1e-3
"""Lower clamp of alpha = roughness**2."""


def evaluate(
    albedo: Array, roughness: Array, metallic: Array, n: Array, wi: Array, wo: Array
) -> Array:
    """[..., 3] float64 f_r = f_s + (1 - M) f_d in 1 / sr; 0 where wi and wo lie on different sides of the surface.

    albedo: [..., 3]. roughness, metallic: [...]. n, wi, wo: [..., 3] unit, directions away from the surface.
    """
    albedo, roughness, metallic = (np.asarray(x, np.float64) for x in (albedo, roughness, metallic))
    c0, c1, c2 = np.moveaxis(diffuse_coefficients(n, wi, wo), -1, 0)
    diffuse = albedo / np.pi * (c0 + c1 * roughness + c2 * roughness**2)[..., None]
    s0, s1 = specular_split(roughness, n, wi, wo)
    base = base_reflectance(albedo, metallic)
    above = (_dot(n, wi) * _dot(n, wo) > 0)[..., None]
    return np.where(
        above, base * s0[..., None] + s1[..., None] + (1 - metallic)[..., None] * diffuse, 0
    )


def base_reflectance(albedo: Array, metallic: Array) -> Array:
    """C_0 = R_0 (1 - M) + M A, [..., 3], of albedo [..., 3] and metallic [...]."""
    metallic = np.asarray(metallic)[..., None]
    return DIELECTRIC_R0 * (1 - metallic) + metallic * albedo


def diffuse_coefficients(n: Array, wi: Array, wo: Array) -> Array:
    """[..., 3] (c0, c1, c2) with pi f_d / A = F_d(wi) F_d(wo) = c0 + c1 R + c2 R^2, unit directions [..., 3].

    F_d(w) = 1 + (F_D90 - 1)(1 - n.w)^5 is linear in F_D90 = 0.5 + 2 R (h.w)^2, hence in R.
    """
    cos_i, cos_o, _, cos_d = _cosines(n, wi, wo)
    fi = _schlick(cos_i)
    fo = _schlick(cos_o)
    slope = 2 * cos_d**2
    at_zero_i = 1 - 0.5 * fi
    at_zero_o = 1 - 0.5 * fo
    return np.stack(
        [at_zero_i * at_zero_o, slope * (at_zero_i * fo + at_zero_o * fi), slope**2 * fi * fo], -1
    )


def specular_split(roughness: Array, n: Array, wi: Array, wo: Array) -> tuple[Array, Array]:
    """(s0, s1), each [...], with f_s = C_0 s0(R) + s1(R): the modified Schlick F_s split by its C_0."""
    cos_i, cos_o, sin2_h, cos_d = _cosines(n, wi, wo)
    alpha = np.maximum(np.asarray(roughness, np.float64) ** 2, MIN_ALPHA)
    # D = a^2 / (pi (cos^2 (a^2 - 1) + 1)^2), with 1 - cos^2 = sin^2 written out so that nothing cancels.
    d = alpha**2 / (np.pi * (alpha**2 * (1 - sin2_h) + sin2_h) ** 2)
    g = _smith_g1(cos_i, alpha) * _smith_g1(cos_o, alpha)
    shape = d * g / np.maximum(4 * cos_i * cos_o, 1e-12)
    fresnel = _schlick(cos_d)
    return shape * (1 - fresnel), shape * fresnel


def hemisphere(count: int) -> Array:
    """[count, count, 3] directions about +Z, each of the solid angle 2 pi / count^2."""
    z, phi = np.meshgrid(
        (np.arange(count) + 0.5) / count, (np.arange(count) + 0.5) / count * 2 * np.pi
    )
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(phi), sine * np.sin(phi), z], -1)


def _cosines(n, wi, wo):
    """|n.wi|, |n.wo|, squared sine of h to n, and h.wo; each [...]."""
    n, wi, wo = (np.asarray(x, np.float64) for x in (n, wi, wo))
    h = wi + wo
    h = h / np.maximum(np.linalg.norm(h, axis=-1, keepdims=True), 1e-12)
    sin2_h = (np.cross(np.broadcast_to(n, h.shape), h) ** 2).sum(-1)
    return np.abs(_dot(n, wi)), np.abs(_dot(n, wo)), sin2_h, _dot(h, wo)


def _dot(a, b):
    return (np.asarray(a, np.float64) * np.asarray(b, np.float64)).sum(-1)


def _schlick(cosine):
    return np.clip(1 - cosine, 0, 1) ** 5


def _smith_g1(cosine, alpha):
    tan2 = (1 - np.clip(cosine, 1e-6, 1) ** 2) / np.clip(cosine, 1e-6, 1) ** 2
    return 2 / (1 + np.sqrt(1 + alpha**2 * tan2))
