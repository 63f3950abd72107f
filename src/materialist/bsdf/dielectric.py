"""What a transparent surface does to a ray: Snell's law, Fresnel's equations, and rough surfaces of both.

Directions are unit vectors [..., 3] along which light is followed; normals are unit and point against the ray.
"""

import numpy as np

from materialist.bsdf import ggx
from materialist.types import Array


def refract(direction: Array, normal: Array, ratio: float) -> tuple[Array, Array]:
    """Snell's law in vector form (paper, Material Transparency Editing: the direction omega_t).

    Of unit directions [..., 3] at unit normals [..., 3] with normal . direction <= 0; `ratio`: index of refraction of
    the side the ray comes from, over that of the other. Returns the unit directions beyond the surface, and [...] bool
    where there is none because all light is reflected; the direction is then that of the reflection.
    """
    # sin(theta_t) = ratio sin(theta_i), written in cosines; below 0 there is no refracted ray.
    cosine = np.clip(-np.sum(direction * normal, -1, keepdims=True), 0, 1)
    squared = 1 - ratio**2 * (1 - cosine**2)  # cosine squared on the other side
    bent = ratio * direction + (ratio * cosine - np.sqrt(np.maximum(squared, 0))) * normal
    total = squared[..., 0] < 0
    return np.where(total[..., None], reflect(direction, normal), bent), total


def reflect(direction: Array, normal: Array) -> Array:
    """[..., 3] mirror direction of a unit direction at a unit normal."""
    return direction - 2 * np.sum(direction * normal, -1, keepdims=True) * normal


def fresnel_dielectric(cosine: Array, ior: float) -> Array:
    """Exact reflectance [...] of unpolarised light (F_s of the paper's f_glass, without Schlick's approximation).

    `cosine`: [...] of the angle between the ray and the normal, in [0, 1]. `ior`: index of refraction of the other side
    over that of the side the ray comes from. In [0, 1]; 1 where reflection is total.
    """
    cosine = np.clip(cosine, 0, 1)
    squared = 1 - (1 - cosine**2) / ior**2
    other = np.sqrt(np.maximum(squared, 0))
    with np.errstate(invalid="ignore", divide="ignore"):
        # r_p and r_s, the amplitudes of both polarisations; unpolarised light has the mean of
        # their squares.
        parallel = (ior * cosine - other) / (ior * cosine + other)
        across = (cosine - ior * other) / (cosine + ior * other)
    both = 0.5 * (parallel**2 + across**2)
    return np.where((squared <= 0) | ~np.isfinite(both), 1.0, both)


def visible_facet(direction: Array, normal: Array, alpha: float, u: float, v: float) -> Array:
    """[..., 3] facet of a rough surface that a ray meets: GGX, spherical caps (Dupuy and Benyoub 2023).

    `alpha` is the roughness squared, (u, v) a point in [0, 1)^2; alpha 0 gives the normal itself.
    """
    if alpha <= 0:
        return normal
    # In the frame of the normal, from the side that the ray comes from.
    right, up = _tangents(normal)
    back = -direction
    x, y, z = ggx.visible_normal([np.sum(back * t, -1) for t in (right, up, normal)], alpha, u, v)
    return x[..., None] * right + y[..., None] * up + z[..., None] * normal


def masking(direction: Array, normal: Array, alpha: float) -> Array:
    """Smith's G1 [...] of GGX: the part of a rough surface not hidden along a direction."""
    return ggx.smith_g1(np.sum(direction * normal, -1), alpha)


def _tangents(normal: Array) -> tuple[Array, Array]:
    """Two unit vectors [..., 3] each that make a right-handed frame with the normal (Duff et al. 2017)."""
    x = normal[..., 0]
    y = normal[..., 1]
    z = normal[..., 2]
    # Without a branch at the pole: the sign keeps the denominator from 0.
    sign = np.where(z < 0, -1.0, 1.0)
    a = -1 / (sign + z)
    b = x * y * a
    return np.stack([1 + sign * x * x * a, sign * b, -sign * x], -1), np.stack(
        [b, sign + y * y * a, -y], -1
    )
