"""The two lobes of the BRDF for Dr.Jit: values, sampling, and normals that see below the face they belong to.

Directions are unit vectors in the local shading frame, above the surface. As in Mitsuba, `wi` points to the viewer.
"""

import drjit as dr
import mitsuba as mi

from materialist.bsdf import ggx
from materialist.bsdf.disney import (
    base_reflectance,
    diffuse_coefficients,
    fresnel,
    half_vector_density,
    quadratic,
)

AGREEING = 0.7
"""Least cosine between shading and geometric normal for the face to block light. Below it the face is taken for a
depth edge that the prediction smeared."""


def half_vector(wi, wo):
    """h, its squared sine to the normal, and h.wo."""
    h = dr.normalize(wi + wo)
    return h, h.x * h.x + h.y * h.y, dr.dot(h, wo)


def diffuse(wi, wo, roughness):
    """f_d cos(theta_o) of a white dielectric."""
    cos_d = half_vector(wi, wo)[2]
    return quadratic(diffuse_coefficients(wo.z, wi.z, cos_d), roughness) * wo.z * dr.inv_pi


def specular(wi, wo, alpha, base):
    """f_s cos(theta_o) of base reflectance C_0."""
    _, sin2, cos_d = half_vector(wi, wo)
    # f_s = F D G / (4 cos_i cos_o) with G = G1(wi) G1(wo); cos(theta_o) cancels against one of
    # the cosines.
    return fresnel(base, cos_d) * (
        half_vector_density(wi.z, sin2, alpha) * ggx.smith_g1(wo.z, alpha)
    )


def reflectance(wi, wo, albedo, roughness, metallic):
    """f_r cos(theta_o) with f_r = f_s + (1 - M) f_d (paper, Preliminary), for directions above the surface."""
    diffuse_part = albedo * (1 - metallic) * diffuse(wi, wo, roughness)
    base = base_reflectance(albedo, metallic)
    return diffuse_part + specular(wi, wo, ggx.alpha_of(roughness), base)


def density(wi, wo, alpha, probability):
    """Density with which `sample_direction` draws `wo`; `probability` is that of the specular lobe."""
    # One-sample mixture of both lobes: visible normals, and cosine-weighted directions.
    mirrored = half_vector_density(wi.z, half_vector(wi, wo)[1], alpha)
    return probability * mirrored + (1 - probability) * wo.z * dr.inv_pi


def sample_direction(wi, alpha, take_specular, point):
    """A direction of the specular lobe where `take_specular`, else of the cosine lobe; point: in the unit square."""
    mirrored = mi.reflect(wi, visible_normal_vector(wi, alpha, point))
    return dr.select(take_specular, mirrored, mi.warp.square_to_cosine_hemisphere(point))


def visible_normal_vector(wi, alpha, point):
    """`ggx.visible_normal` as a vector."""
    return mi.Vector3f(*ggx.visible_normal(wi, alpha, point.x, point.y))


def face_towards(face, normal):
    """The normal of a face on the side of a shading normal; 0 where they differ too much for both to be true."""
    cos = dr.dot(face, normal)
    return dr.select(dr.abs(cos) > AGREEING, face * dr.sign(cos), 0)


def lifted(direction, face):
    """The direction, mirrored at the plane with the normal `face` where it lies below it: nothing comes through an
    opaque surface, and nothing is lost."""
    return direction - 2 * dr.minimum(dr.dot(direction, face), 0) * face
