"""The formulas of the paper's simplified Disney BRDF (section Preliminary), written once for numpy, torch and Dr.Jit.

f_r = f_s + (1 - M) f_d: `bsdf.lobes.reflectance` puts it together for the path tracer, `transport.shading.shade` for
cached light. Choices that the paper leaves open (docs/rendering.md): the Smith term is separable, as in Mitsuba;
alpha = R^2 is at least `ggx.MIN_ALPHA`; both sides of a surface shade alike.
"""

from materialist.bsdf.ggx import array_module, distribution, smith_g1

ETA = 1.5
"""Relative index of refraction of the dielectric part."""

DIELECTRIC_R0 = ((ETA - 1) / (ETA + 1)) ** 2
"""R_0(eta): Fresnel reflectance at normal incidence, 0.04."""


def base_reflectance(albedo, metallic):
    """C_0 = R_0 (1 - M) + M A."""
    return DIELECTRIC_R0 * (1 - metallic) + metallic * albedo


def schlick_weight(cosine):
    """Schlick's weight (1 - cos)^5; the reflectance F is `fresnel`."""
    # Powers by products: exact in every library, and cheaper to differentiate.
    m = array_module(cosine).clip(1 - cosine, 0, 1)
    m2 = m * m
    return m2 * m2 * m


def diffuse_coefficients(cos_i, cos_o, cos_d):
    """(c0, c1, c2) with pi f_d / A = F_d(wi) F_d(wo) = c0 + c1 R + c2 R^2; `cos_d` is h.wi.

    F_d(w) = 1 + (F_D90 - 1)(1 - n.w)^5 is linear in F_D90 = 0.5 + 2 R (h.w)^2, hence in R.
    """
    # F_d(w) = 1 - 0.5 f + 2 R (h.w)^2 f with f = (1 - n.w)^5: a constant and a slope in R for
    # each direction.
    fi = schlick_weight(cos_i)
    fo = schlick_weight(cos_o)
    slope = 2 * cos_d * cos_d
    at_zero_i = 1 - 0.5 * fi
    at_zero_o = 1 - 0.5 * fo
    return at_zero_i * at_zero_o, slope * (at_zero_i * fo + at_zero_o * fi), slope * slope * fi * fo


def quadratic(coefficients, roughness):
    """c0 + c1 R + c2 R^2."""
    c0, c1, c2 = coefficients
    return c0 + roughness * (c1 + roughness * c2)


def combine(albedo, metallic, diffuse, s0, s1):
    """A (1 - M) diffuse + C_0 s0 + s1: radiance by lobe, for the light that each lobe's factors have gathered."""
    return albedo * (1 - metallic) * diffuse + base_reflectance(albedo, metallic) * s0 + s1


def combine_by_albedo(metallic, diffuse, s0, s1):
    """`combine` as a linear function of the albedo A: (what A multiplies, the rest).

    C_0 = R_0 (1 - M) + M A, so that its second term belongs to the first part.
    """
    base = base_reflectance(0, metallic)  # C_0 at A = 0
    return metallic * s0 + (1 - metallic) * diffuse, base * s0 + s1


def fresnel(base, cosine):
    """F_s: Schlick's reflectance of base reflectance C_0."""
    return base + (1 - base) * schlick_weight(cosine)


def half_vector_density(cos_view, sin2_h, alpha):
    """Density, per solid angle, of the view direction reflected at a visible normal: D(h) G1(v) / (4 n.v)."""
    return (
        # D(h) G1(v) max(h.v, 0) / (n.v) over the Jacobian 4 (h.v) of the reflection.
        distribution(sin2_h, alpha)
        * smith_g1(cos_view, alpha)
        / (4 * array_module(cos_view).clip(cos_view, 1e-6, 1))
    )


def specular_probability(cosine, luminance, metallic):
    """With which probability to sample the specular lobe: its share of the reflectance, 0.1 at least."""
    # A grey of the same luminance stands for the colour; neither lobe may starve.
    specular = fresnel(base_reflectance(luminance, metallic), cosine)
    diffuse = (1 - metallic) * luminance
    xp = array_module(cosine)
    return xp.clip(specular / xp.clip(specular + diffuse, 1e-6, 4), 0.1, 1)
