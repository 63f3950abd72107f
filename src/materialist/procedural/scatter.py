"""The project's BRDF (paper, section Preliminary) for the data set's path tracer: diffuse and specular apart."""

from __future__ import annotations


def value(wi, wo, look):
    """(f_d cos of a white dielectric, f_s cos [3], sampling density) for local unit directions; 0 below the surface."""
    import drjit as dr
    import mitsuba as mi

    from materialist.bsdf import lobes
    from materialist.bsdf.disney import base_reflectance
    from materialist.bsdf.ggx import alpha_of

    above, alpha = (wi.z > 0) & (wo.z > 0), alpha_of(look.roughness)
    specular = lobes.specular(wi, wo, alpha, base_reflectance(look.albedo, look.metallic))
    density = lobes.density(wi, wo, alpha, _specular_probability(wi, look))
    return (
        dr.select(above, lobes.diffuse(wi, wo, look.roughness), 0),
        dr.select(above, specular, mi.Color3f(0)),
        dr.select(above, density, 0),
    )


def sample(wi, look, draws):
    """A local direction drawn with the density that `value` gives."""
    from materialist.bsdf import lobes
    from materialist.bsdf.ggx import alpha_of

    return lobes.sample(wi, alpha_of(look.roughness), draws.lobe < _specular_probability(wi, look), draws.bsdf)


def _specular_probability(wi, look):
    import mitsuba as mi

    from materialist.bsdf.disney import specular_probability

    return specular_probability(wi.z, mi.luminance(look.albedo), look.metallic)
