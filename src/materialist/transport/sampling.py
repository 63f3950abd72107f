"""Directions for the transport cache: low-discrepancy points, cosine lobes and visible GGX normals.

All functions act on Dr.Jit arrays of the active variant; vectors are in the local shading frame (+Z the normal).
"""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.types import Array

TILE = 4
"""Neighbouring pixels in a TILE x TILE block draw interleaved parts of one point set, for the filter to join."""

MIN_ALPHA = 1e-3
"""Lower clamp of alpha = roughness**2, shared with the path tracer's BSDF."""

# Generators of the R2 sequence (Roberts 2018): 1/g, 1/g^2 with g the plastic number.
R2 = (0.7548776662466927, 0.5698402909980532)


AGREEING = 0.7
"""Least cosine between a shading normal and its face for the face to hold back light: where a predicted depth slopes
and the predicted normal does not, the slope is an outline that was smeared, and what it hides was never hidden."""


def pixel_shift(height: int, width: int, seed: int) -> Array:
    """[H, W, 2] float32 rotation of the point set per pixel: stratified over each tile, the same in all tiles."""
    rank = np.random.default_rng(seed).permutation(TILE * TILE).reshape(TILE, TILE)
    rows, cols = np.indices((height, width))
    order = rank[rows % TILE, cols % TILE].astype(np.float64)
    base = np.random.default_rng(seed + 1).random(2)
    return np.stack([(base[k] + order * R2[k]) % 1.0 for k in (0, 1)], -1).astype(np.float32)


def point(index, count, shift):
    """Point `index` of `count` in [0, 1)^2: a rank-1 lattice (Fibonacci) in the unit square, rotated by `shift`."""
    i = mi.Float(index)
    u = (i + 0.5) / mi.Float(count) + shift.x
    v = i * 0.6180339887498949 + shift.y
    return mi.Point2f(u - dr.floor(u), v - dr.floor(v))


def cosine_direction(sample):
    """Cosine-weighted direction of the upper hemisphere; pdf = cos / pi."""
    return mi.warp.square_to_cosine_hemisphere(sample)


def visible_normal(wo, alpha, sample):
    """GGX normal distributed as the normals visible from `wo` (spherical-cap method, Dupuy and Benyoub 2023)."""
    stretched = dr.normalize(mi.Vector3f(alpha * wo.x, alpha * wo.y, wo.z))
    phi = dr.two_pi * sample.x
    z = dr.fma(1 - sample.y, 1 + stretched.z, -stretched.z)
    sin_theta = dr.safe_sqrt(1 - z * z)
    s, c = dr.sincos(phi)
    h = mi.Vector3f(sin_theta * c, sin_theta * s, z) + stretched
    return dr.normalize(mi.Vector3f(alpha * h.x, alpha * h.y, dr.maximum(h.z, 1e-6)))


def ggx(h, alpha):
    """GGX normal distribution D(h) of a local unit vector h.

    The squared sine comes from h.x and h.y: 1 - h.z^2 would lose all its digits where alpha is small.
    """
    a2 = alpha * alpha
    d = h.x * h.x + h.y * h.y + a2 * h.z * h.z
    return a2 / (dr.pi * d * d)


def smith_g1(cos_theta, alpha):
    """Smith masking of GGX for a direction with cosine `cos_theta` to the normal."""
    c2 = cos_theta * cos_theta
    tan2 = (1 - c2) / dr.maximum(c2, 1e-12)
    return dr.select(cos_theta > 0, 2 / (1 + dr.sqrt(1 + alpha * alpha * tan2)), 0)


def schlick(cos_theta):
    """(1 - cos)^5 of Schlick's approximation."""
    m = dr.clip(1 - cos_theta, 0, 1)
    m2 = m * m
    return m2 * m2 * m


def diffuse_polynomial(cos_i, cos_o, cos_d):
    """Coefficients (c0, c1, c2) with F_d(wi) F_d(wo) = c0 + c1 R + c2 R^2 (paper, Preliminary: F_D90 is linear in R).

    `cos_d` is h.wi. F_d(w) = 1 + (F_D90 - 1)(1 - n.w)^5 with F_D90 = 0.5 + 2 R cos_d^2.
    """
    fi, fo = schlick(cos_i), schlick(cos_o)
    g = 2 * cos_d * cos_d
    a_i, a_o = 1 - 0.5 * fi, 1 - 0.5 * fo
    return a_i * a_o, g * (a_i * fo + a_o * fi), g * g * fi * fo


def face_towards(face, normal):
    """The normal of a face on the side of a shading normal; 0 where they differ too much for both to be true."""
    cos = dr.dot(face, normal)
    return dr.select(dr.abs(cos) > AGREEING, face * dr.sign(cos), 0)


def lifted(direction, face):
    """The direction, mirrored at the plane with the normal `face` where it lies below it.

    A shading normal sees below the face it belongs to, and a ray from there would come through an opaque surface.
    Mirrored, nothing passes and nothing is lost.
    """
    return direction - 2 * dr.minimum(dr.dot(direction, face), 0) * face
