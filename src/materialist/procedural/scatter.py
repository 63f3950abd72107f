"""The project's BRDF (paper, section Preliminary) for the data set's path tracer: diffuse and specular apart."""

from __future__ import annotations


def _cosines(wi, wo):
    import drjit as dr

    h = dr.normalize(wi + wo)
    return h, dr.dot(h, wo)


def _specular_share(cos_i, look):
    """Probability of the specular lobe, as `render.bsdf` chooses it."""
    import drjit as dr
    import mitsuba as mi

    from materialist.bsdf.disney import DIELECTRIC_R0
    from materialist.transport.sampling import schlick

    luma = mi.luminance(look.albedo)
    base = DIELECTRIC_R0 * (1 - look.metallic) + look.metallic * luma
    specular = base + (1 - base) * schlick(cos_i)
    return dr.clip(specular / dr.maximum(specular + (1 - look.metallic) * luma, 1e-6), 0.1, 1)


def value(wi, wo, look):
    """(f_d cos of a white dielectric, f_s cos [3], sampling density) for local unit directions; 0 below the surface."""
    import drjit as dr
    import mitsuba as mi

    from materialist.bsdf.disney import DIELECTRIC_R0
    from materialist.transport.sampling import MIN_ALPHA, diffuse_polynomial, ggx, schlick, smith_g1

    above = (wi.z > 0) & (wo.z > 0)
    alpha = dr.maximum(look.roughness * look.roughness, MIN_ALPHA)
    h, cos_d = _cosines(wi, wo)
    c0, c1, c2 = diffuse_polynomial(wo.z, wi.z, cos_d)
    diffuse = dr.inv_pi * (c0 + look.roughness * (c1 + look.roughness * c2)) * wo.z
    base = DIELECTRIC_R0 * (1 - look.metallic) + look.metallic * look.albedo
    fresnel = base + (1 - base) * schlick(cos_d)
    d, g1 = ggx(h, alpha), smith_g1(wi.z, alpha) / (4 * dr.maximum(wi.z, 1e-6))
    specular = fresnel * (d * g1 * smith_g1(wo.z, alpha))
    share = _specular_share(wi.z, look)
    density = share * d * g1 + (1 - share) * wo.z * dr.inv_pi
    return dr.select(above, diffuse, 0), dr.select(above, specular, mi.Color3f(0)), dr.select(above, density, 0)


def sample(wi, look, draws):
    """A local direction drawn with the density that `value` gives."""
    import drjit as dr
    import mitsuba as mi

    from materialist.transport.sampling import MIN_ALPHA, cosine_direction, visible_normal

    alpha = dr.maximum(look.roughness * look.roughness, MIN_ALPHA)
    mirrored = mi.reflect(wi, visible_normal(wi, alpha, draws.bsdf))
    return dr.select(draws.lobe < _specular_share(wi.z, look), mirrored, cosine_direction(draws.bsdf))
