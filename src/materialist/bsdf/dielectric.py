"""What a transparent surface does to a ray: Snell's law, Fresnel's equations, and rough surfaces of both.

Directions are unit vectors [..., 3] along which light is followed; normals are unit and point against the ray.
`eta` is n_t / n_i: index of refraction beyond the surface over that of the side the ray comes from.
"""

import numpy as np

from materialist.bsdf import ggx
from materialist.types import Array


def refract(direction: Array, normal: Array, eta: float) -> tuple[Array, Array]:
    """Snell's law in vector form (paper, Material Transparency Editing: the direction omega_t).

    Of unit directions [..., 3] at unit normals [..., 3] with normal . direction <= 0; `eta`: n_t / n_i. Returns the
    unit directions beyond the surface, and [...] bool where there is none because all light is reflected; the direction
    is then that of the reflection.
    """
    inverse_eta = 1 / eta
    cos_i = np.clip(-np.sum(direction * normal, -1, keepdims=True), 0, 1)
    # Snell: sin_t = sin_i / eta; above 1 there is no refracted ray.
    sin2_t = inverse_eta**2 * (1 - cos_i**2)
    cos_t = np.sqrt(np.maximum(1 - sin2_t, 0))
    refracted = inverse_eta * direction + (inverse_eta * cos_i - cos_t) * normal
    is_total = sin2_t[..., 0] > 1
    return np.where(is_total[..., None], reflect(direction, normal), refracted), is_total


def reflect(direction: Array, normal: Array) -> Array:
    """[..., 3] mirror direction of a unit direction at a unit normal."""
    return direction - 2 * np.sum(direction * normal, -1, keepdims=True) * normal


def fresnel_dielectric(cosine: Array, eta: float) -> Array:
    """Exact reflectance [...] of unpolarised light (F_s of the paper's f_glass, without Schlick's approximation).

    `cosine`: [...] of the angle between the ray and the normal, in [0, 1]; `eta`: n_t / n_i.
    In [0, 1]; 1 where reflection is total.
    """
    cos_i = np.clip(cosine, 0, 1)
    sin2_t = (1 - cos_i**2) / eta**2
    cos_t = np.sqrt(np.maximum(1 - sin2_t, 0))
    is_total = sin2_t >= 1
    # Amplitudes of both polarisations; unpolarised light reflects the mean of their squares.
    with np.errstate(invalid="ignore", divide="ignore"):
        r_parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
        r_perpendicular = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    reflectance = 0.5 * (r_parallel**2 + r_perpendicular**2)
    return np.where(is_total | ~np.isfinite(reflectance), 1.0, reflectance)


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
