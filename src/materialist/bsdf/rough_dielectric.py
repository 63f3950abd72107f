"""A rough dielectric that loses no light (`materialist_frosted`): Mitsuba's, over its directional albedo.

Facets hide and shade each other. What one of them sends into another is lost in Mitsuba's `roughdielectric`, as in
every single-scattering model (Walter et al. 2007): a fifth at a roughness of 0.5. Glass absorbs nothing, so that this
light leaves after all; it is given to the ways that are known, by one factor for each direction to the eye and side.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from materialist.types import Array

PLUGIN = "materialist_frosted"
COSINES = 32
"""Directions of the table of albedos, even in the cosine."""
FACETS = 64
"""Facets along each of the two axes of the sum over visible normals."""
LEAST = 0.05
"""Albedo below which it is not made up for: hardly anything passes at so flat an angle."""


@lru_cache(maxsize=64)
def directional_albedo(ior: float, alpha: float) -> Array:
    """[2, COSINES] share of the light from a direction that leaves after one facet: from outside, and from within.

    Sum over visible GGX normals m of F(m) G1(reflected) + (1 - F(m)) G1(refracted), Smith's G1; cosines are
    (k + 1/2) / COSINES. alpha: GGX width, roughness^2; ior: within over outside.
    """
    u = (np.arange(FACETS) + 0.5) / FACETS
    u, v = np.meshgrid(u, u)
    cosine = ((np.arange(COSINES) + 0.5) / COSINES)[:, None, None]
    wi = np.stack(np.broadcast_arrays(np.sqrt(1 - cosine**2), 0 * cosine, cosine), -1)
    m = _visible_normal(wi, alpha, u, v)  # [N, FACETS, FACETS, 3]
    along = (wi * m).sum(-1)
    found = []
    for relative in (ior, 1 / ior):
        from_grating = 1 - (1 - along**2) / relative**2
        into = np.sqrt(np.maximum(from_grating, 0))
        s, p = (
            ((along - relative * into) / (along + relative * into)),
            ((relative * along - into) / (relative * along + into)),
        )
        fresnel = np.where(from_grating > 0, (s**2 + p**2) / 2, 1.0)
        mirrored = 2 * along[..., None] * m - wi
        refracted = (along / relative - into)[..., None] * m - wi / relative
        shares = [
            np.where(sign * w[..., 2] > 0, _smith_g1(w[..., 2], alpha), 0)
            for sign, w in ((1, mirrored), (-1, refracted))
        ]
        found.append((fresnel * shares[0] + (1 - fresnel) * shares[1]).mean((1, 2)))
    return np.stack(found)


def _visible_normal(wi: Array, alpha: float, u: Array, v: Array) -> Array:
    """Visible GGX normals from directions [..., 1, 1, 3], as `transport.sampling.visible_normal`."""
    stretched = wi * [alpha, alpha, 1]
    stretched = stretched / np.linalg.norm(stretched, axis=-1, keepdims=True)
    z = (1 - v) * (1 + stretched[..., 2]) - stretched[..., 2]
    sine = np.sqrt(np.maximum(1 - z**2, 0))
    h = np.stack([sine * np.cos(2 * np.pi * u), sine * np.sin(2 * np.pi * u), z], -1) + stretched
    h = np.stack([alpha * h[..., 0], alpha * h[..., 1], np.maximum(h[..., 2], 1e-6)], -1)
    return h / np.linalg.norm(h, axis=-1, keepdims=True)


def _smith_g1(cosine: Array, alpha: float) -> Array:
    squared = np.maximum(cosine**2, 1e-12)
    return 2 / (1 + np.sqrt(1 + alpha**2 * (1 - squared) / squared))


def register() -> None:
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
            params = mi.traverse(self.interface)
            ior, alpha = (float(np.array(params[name]).ravel()[0]) for name in ("eta", "alpha.value"))
            self.table = mi.Float(np.maximum(directional_albedo(ior, alpha), LEAST).ravel())

        def traverse(self, cb):
            cb.put("interface", self.interface, mi.ParamFlags.NonDifferentiable)

        def parameters_changed(self, keys=()):
            self._tabulate()

        def _gain(self, si, active):
            """One over the albedo of the direction to the eye, between the entries of the table."""
            at = dr.clip(dr.abs(si.wi.z) * COSINES - 0.5, 0, COSINES - 1)
            first = dr.minimum(mi.UInt32(at), COSINES - 2)
            start = first + dr.select(si.wi.z > 0, mi.UInt32(0), mi.UInt32(COSINES))
            low, high = (dr.gather(mi.Float, self.table, start + k, active) for k in (0, 1))
            return dr.rcp(dr.maximum(dr.lerp(low, high, at - mi.Float(first)), LEAST))

        def sample(self, ctx, si, sample1, sample2, active=True):
            found, weight = self.interface.sample(ctx, si, sample1, sample2, active)
            return found, weight * self._gain(si, active)

        def eval(self, ctx, si, wo, active=True):
            return self.interface.eval(ctx, si, wo, active) * self._gain(si, active)

        def pdf(self, ctx, si, wo, active=True):
            return self.interface.pdf(ctx, si, wo, active)

        def eval_pdf(self, ctx, si, wo, active=True):
            value, density = self.interface.eval_pdf(ctx, si, wo, active)
            return value * self._gain(si, active), density

        def to_string(self):
            return f"Frosted[{self.interface}]"

    mi.register_bsdf(PLUGIN, Frosted)
