"""The rays of a light matrix: through every texel of the envmap, and along the specular lobe, weighed together.

A lobe alone seldom meets a low sun: of 256 cosine-weighted rays one in twelve pixels sends one into a texel of a map of
32 rows that stands 8 degrees high. A ray through each texel meets every light, and its noise is that of visibility
alone; a narrow lobe falls between them. Each ray counts by the balance heuristic (Veach and Guibas 1995).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.bsdf.disney import (
    combine_by_albedo,
    diffuse_coefficients,
    half_vector_density,
    quadratic,
    schlick_weight,
)
from materialist.bsdf.ggx import alpha_of, smith_g1
from materialist.bsdf.lobes import half_vector, lifted, visible_normal_vector
from materialist.buffers import floats, integers
from materialist.transport.cache import R2, TransportCache, point, spawn
from materialist.types import Array

STEPS = tuple(round(g * 2**32) for g in R2)
"""The R2 sequence spreads the places of rays in their texels; its generators as fractions of 2^32."""
LANES = 1 << 20
"""Rays that are followed at once."""


@dataclass(frozen=True)
class Rays:
    """N rays that leave some of Q rows, and what a unit of radiance from their other end adds to a row's radiance."""

    ray: Any
    row: Array
    """[N] int64."""
    weights: tuple[Array, Array]
    """Each [N]: what the albedo multiplies, and the rest."""


class LobeRays:
    """The rays of the surface pixels `cache.pixels[rows]`, Q of them.

    rows: [Q]. rough, metallic: [Q]; perceptual roughness. shape: (h, 2h) of the envmap. per_texel: rays of a row
    through each texel. specular: rays of a row along the visible normals of its specular lobe.
    """

    def __init__(
        self,
        cache: TransportCache,
        rows: Array,
        rough: Array,
        metallic: Array,
        shape: tuple[int, int],
        per_texel: int,
        specular: int,
    ):
        self.cache = cache
        self.shape = shape
        self.per_texel = per_texel
        self.specular = specular
        self._rows = integers(mi, rows)
        self._rough = floats(mi, rough)
        self._metallic = floats(mi, metallic)
        self._alpha = floats(mi, alpha_of(rough))

    def parts(self) -> Iterator[Rays]:
        """All rays, some rows at a time."""
        total = dr.width(self._rows)
        # Whole rows at a time, so that memory stays bounded whatever the size of the map.
        at_once = max(
            1, LANES // max(self.shape[0] * self.shape[1] * self.per_texel, self.specular)
        )
        for first in range(0, total, at_once):
            rows = dr.opaque(mi.UInt32, first), min(at_once, total - first)
            yield self._through_texels(*rows)
            if self.specular:
                yield self._along_normals(*rows)

    def _through_texels(self, first: Any, count: int) -> Rays:
        """A ray of every row through some place of every part of every texel; uniform in solid angle there."""
        # --- Lanes: (part of a texel, row); those below the surface are dropped first ---
        lane = dr.arange(mi.UInt32, count * self.shape[0] * self.shape[1] * self.per_texel)
        normal = self._take(self.cache.normal, first + lane % count)
        lane = mi.UInt32(
            dr.compress(dr.dot(self._texel(lane // count, first + lane % count), normal) > 0)
        )
        row = first + lane % count
        world = self._texel(lane // count, row)
        wi = mi.Frame3f(self._take(self.cache.normal, row)).to_local(world)
        wo = self._take(self.cache.wo, row)
        rough = dr.gather(mi.Float, self._rough, row)
        # --- Weight of the diffuse lobe: (pi f_d / A) cos / pi, over the density of rays ---
        cos_d = half_vector(wi, wo)[2]
        diffuse = (
            quadratic(diffuse_coefficients(wi.z, wo.z, cos_d), rough)
            * wi.z
            * dr.inv_pi
            / self._density(world)
        )
        return self._rays(world, row, diffuse, self._reflected(world, wi, wo, row))

    def _along_normals(self, first: Any, count: int) -> Rays:
        """`specular` rays of every row, mirrored at its visible normals."""
        lane = dr.arange(mi.UInt32, count * self.specular)
        row = first + lane % count
        # --- Directions: the view mirrored at visible normals of the row's own alpha ---
        wo = self._take(self.cache.wo, row)
        shift = self._take(self.cache.shift, row)
        sample = point(lane // count, dr.opaque(mi.UInt32, self.specular), shift)
        wi = mi.reflect(
            wo, visible_normal_vector(wo, dr.gather(mi.Float, self._alpha, row), sample)
        )
        # --- Weights: of the specular lobe alone, 0 below the surface ---
        world = mi.Frame3f(self._take(self.cache.normal, row)).to_world(wi)
        base, grazing = (dr.select(wi.z > 0, w, 0) for w in self._reflected(world, wi, wo, row))
        return self._rays(world, row, 0, (base, grazing))

    def _texel(self, number: Any, row: Any) -> Any:
        """The direction of each lane through a part of a texel, counted by `number`."""
        texel = number // self.per_texel
        part = number % self.per_texel
        height, width = self.shape
        shift = self._take(self.cache.shift, row)
        # UInt32 as a fraction of 2^32: the top 24 bits, as many as a float holds. Rotated by the pixel's shift.
        u, v = (
            mi.Float(number * step >> 8) * 2.0**-24 + offset
            for step, offset in zip(STEPS, (shift.x, shift.y), strict=True)
        )
        u = u - dr.floor(u)
        v = (mi.Float(part) + v - dr.floor(v)) / self.per_texel
        # Uniform in solid angle: evenly spread in the cosine of the polar angle.
        above = dr.cos(mi.Float(texel // width) * (dr.pi / height))
        below = dr.cos(mi.Float(texel // width + 1) * (dr.pi / height))
        y = dr.lerp(above, below, u)
        azimuth = ((mi.Float(texel % width) + v) / width - 0.5) * dr.two_pi
        flat = dr.safe_sqrt(1 - y * y)
        sin, cos = dr.sincos(azimuth)
        return mi.Vector3f(flat * sin, y, -flat * cos)

    def _density(self, world: Any) -> Any:
        """Rays through texels in a unit of solid angle, by direction."""
        height, width = self.shape
        row = dr.clip(dr.floor(dr.safe_acos(world.y) * (height / dr.pi)), 0, height - 1)
        # Solid angle of a texel: 2 pi / width times the difference of the cosines of its edges.
        y = dr.cos(row * (dr.pi / height)) - dr.cos((row + 1) * (dr.pi / height))
        return self.per_texel * width / (dr.two_pi * dr.maximum(y, 1e-9))

    def _reflected(self, world: Any, wi: Any, wo: Any, row: Any) -> tuple[Any, Any]:
        """What C_0 multiplies of the specular lobe, and the rest of it, for rays of either kind."""
        alpha = dr.gather(mi.Float, self._alpha, row)
        _, sin2, cos_d = half_vector(wi, wo)
        along = half_vector_density(wo.z, sin2, alpha)  # of mirrored rays
        # Balance heuristic: f / (p_texels + n p_mirrored); of f_s cos the factor F stays out.
        value = smith_g1(wi.z, alpha) * along / (self._density(world) + self.specular * along)
        fresnel = schlick_weight(cos_d)
        return (1 - fresnel) * value, fresnel * value

    def _rays(self, world: Any, row: Any, diffuse: Any, specular: tuple[Any, Any]) -> Rays:
        """Rays with their weights, split into the factor of the albedo A and the rest.

        f_r cos = A (1 - M) diffuse + C_0 base + grazing, with C_0 = R_0 (1 - M) + M A.
        """
        cache = self.cache
        metal = dr.gather(mi.Float, self._metallic, row)
        base, grazing = specular
        albedo_weight, rest_weight = combine_by_albedo(metal, diffuse, base, grazing)
        position = self._take(cache.position, row)
        geometric_normal = self._take(cache.geometric_normal, row)
        # The ray leaves the surface on the side of its face, whatever the shading normal says.
        ray = spawn(position, geometric_normal, lifted(world, self._take(cache.face, row)))
        dr.eval(ray, row, albedo_weight, rest_weight)
        weights = (np.array(albedo_weight), np.array(rest_weight))
        return Rays(ray, np.array(row).astype(np.int64), weights)

    def _take(self, values: Any, row: Any) -> Any:
        return dr.gather(type(values), values, dr.gather(mi.UInt32, self._rows, row))
