"""A rough dielectric that loses no light (`materialist_frosted`): Mitsuba's, over its directional albedo.

Facets hide and shade each other. What one of them sends into another is lost in Mitsuba's `roughdielectric`, as in
every single-scattering model (Walter et al. 2007): a fifth at a roughness of 0.5. Glass absorbs nothing, so that this
light leaves after all; it is given to the ways that are known, by one factor for each direction to the eye and side.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from materialist.bsdf.dielectric import fresnel_dielectric, refract
from materialist.bsdf.ggx import smith_g1, visible_normal
from materialist.types import Array

PLUGIN = "materialist_frosted"
COSINES = 32
"""Directions of the table of albedos, even in the cosine."""
FACETS = 64
"""Facets along each of the two axes of the sum over visible normals."""
MIN_ALBEDO = 0.05
"""Albedo below which it is not made up for: hardly anything passes at so flat an angle."""


@lru_cache(maxsize=64)
def directional_albedo(ior: float, alpha: float) -> Array:
    """[2, COSINES] share of the light from a direction that leaves after one facet: from outside, and from within.

    Sum over visible GGX normals m of F(m) G1(reflected) + (1 - F(m)) G1(refracted), Smith's G1; cosines are
    (k + 1/2) / COSINES. alpha: GGX width, roughness^2; ior: within over outside.
    """
    # --- Visible normals at the centres of a grid over the unit square ---
    u = (np.arange(FACETS) + 0.5) / FACETS
    u, v = np.meshgrid(u, u)
    cosine = ((np.arange(COSINES) + 0.5) / COSINES)[:, None, None]
    wi = np.stack(np.broadcast_arrays(np.sqrt(1 - cosine**2), 0 * cosine, cosine), -1)
    m = np.stack(visible_normal(np.moveaxis(wi, -1, 0), alpha, u, v), -1)  # [N, FACETS, FACETS, 3]
    along = (wi * m).sum(-1)
    albedos = []
    for eta in (ior, 1 / ior):
        # --- What leaves after one facet: reflected on the same side, refracted on the other ---
        reflected = fresnel_dielectric(along, eta)
        upward = (2 * along[..., None] * m - wi)[..., 2]
        downward = refract(-wi, m, eta)[0][..., 2]
        shares = [
            np.where(sign * z > 0, smith_g1(z, alpha), 0)
            for sign, z in ((1, upward), (-1, downward))
        ]
        albedos.append((reflected * shares[0] + (1 - reflected) * shares[1]).mean((1, 2)))
    return np.stack(albedos)


def register_frosted() -> None:
    """Make the plugin known to the active variant."""
    import drjit as dr
    import mitsuba as mi

    class Frosted(mi.BSDF):
        """`interface`: a `roughdielectric` of GGX facets, whose values are divided by its directional albedo."""

        def __init__(self, props: mi.Properties):
            mi.BSDF.__init__(self, props)
            interface: Any = props["interface"]
            self.interface = interface
            self.m_components = [interface.flags(k) for k in range(interface.component_count())]
            self.m_flags = interface.flags()
            self._tabulate()

        def _tabulate(self):
            # ior and alpha as the interface has them now: `parameters_changed` asks again.
            params = mi.traverse(self.interface)
            ior = float(np.array(params["eta"]).ravel()[0])
            alpha = float(np.array(params["alpha.value"]).ravel()[0])
            self.table = mi.Float(np.maximum(directional_albedo(ior, alpha), MIN_ALBEDO).ravel())

        def traverse(self, cb):
            cb.put("interface", self.interface, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys=()):
            self._tabulate()

        def _gain(self, si, active):
            """One over the albedo of the direction to the eye, between the entries of the table."""
            # Linear between the table's entries: the first half from outside, the second from
            # within.
            at = dr.clip(dr.abs(si.wi.z) * COSINES - 0.5, 0, COSINES - 1)
            first = dr.minimum(mi.UInt32(at), COSINES - 2)
            start = first + dr.select(si.wi.z > 0, mi.UInt32(0), mi.UInt32(COSINES))
            low, high = (dr.gather(mi.Float, self.table, start + k, active) for k in (0, 1))
            return dr.rcp(dr.maximum(dr.lerp(low, high, at - mi.Float(first)), MIN_ALBEDO))

        def sample(self, ctx, si, sample1, sample2, active=True):
            sampled, weight = self.interface.sample(ctx, si, sample1, sample2, active)
            return sampled, weight * self._gain(si, active)

        def eval(self, ctx, si, wo, active=True):
            return self.interface.eval(ctx, si, wo, active) * self._gain(si, active)

        def pdf(self, ctx, si, wo, active=True):
            # The gain is on values alone: directions are drawn as before.
            return self.interface.pdf(ctx, si, wo, active)

        def eval_pdf(self, ctx, si, wo, active=True):
            value, density = self.interface.eval_pdf(ctx, si, wo, active)
            return value * self._gain(si, active), density

        def to_string(self):
            return f"Frosted[{self.interface}]"

    mi.register_bsdf(PLUGIN, Frosted)
