"""The rays of a light matrix: through every texel of the envmap, and along the specular lobe, weighed together.

A lobe alone seldom meets a low sun: of 256 cosine-weighted rays one in twelve pixels sends one into a texel of a map of
32 rows that stands 8 degrees high. A ray through each texel meets every light, and its noise is that of visibility
alone; a narrow lobe falls between them. Each ray counts by the balance heuristic (Veach and Guibas 1995).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from materialist.render.buffers import floats, integers
from materialist.transport.cache import TransportCache, spawn
from materialist.transport.sampling import (
    MIN_ALPHA,
    diffuse_polynomial,
    ggx,
    lifted,
    point,
    schlick,
    smith_g1,
    visible_normal,
)
from materialist.types import Array

LANES = 1 << 22
"""Rays that are followed at once."""


@dataclass(frozen=True)
class Rays:
    """N rays that leave some of Q rows, and what a unit of radiance from their other end adds to the rows' lobes."""

    ray: Any
    row: Array
    """[N] int64."""
    lobes: tuple[int, ...]
    """The lobes of `LightMatrix` that they are part of."""
    weights: tuple[Any, ...]
    """[N] of each of those lobes."""


def rays(
    cache: TransportCache, rows: Array, rough: Array, shape: tuple[int, int], per_texel: int, specular: int
) -> Iterator[Rays]:
    """All rays of the surface pixels `cache.pixels[rows]`, in parts.

    Args:
        rows: [Q]. rough: [Q] perceptual roughness.
        shape: (h, 2h) of the envmap. per_texel: rays of a row through each texel.
        specular: rays of a row along the visible normals of its specular lobe.
    """
    texels = shape[0] * shape[1] * per_texel
    at_once = max(1, LANES // max(texels, specular))
    for start in range(0, len(rows), at_once):
        these = slice(start, start + at_once)
        lobe = _Lobe(cache, rows[these], rough[these], shape, per_texel, specular)
        yield lobe.through_texels(start)
        yield lobe.along_normals(start)


class _Lobe:
    """What a set of rows sends out."""

    def __init__(
        self, cache: TransportCache, rows: Array, rough: Array, shape: tuple[int, int], per_texel: int, specular: int
    ):
        self.cache, self.shape, self.per_texel, self.specular = cache, shape, per_texel, specular
        self.count = len(rows)
        self._rows = integers(mi, rows)
        self._rough = floats(mi, rough)
        self._alpha = floats(mi, np.maximum(rough**2, MIN_ALPHA))

    def through_texels(self, first: int) -> Rays:
        """A ray of every row through a random place of every part of every texel; uniform in solid angle there."""
        lane = dr.arange(mi.UInt32, self.count * self.shape[0] * self.shape[1] * self.per_texel)
        normal = self._take(self.cache.normal, lane % self.count)
        lane = mi.UInt32(dr.compress(dr.dot(self._texel(lane), normal) > 0))
        world, row = self._texel(lane), lane % self.count
        wi = mi.Frame3f(self._take(self.cache.normal, row)).to_local(world)
        wo = self._take(self.cache.wo, row)
        h = dr.normalize(wi + wo)
        c0, c1, c2 = diffuse_polynomial(wi.z, wo.z, dr.dot(h, wi))
        rough = dr.gather(mi.Float, self._rough, row)
        diffuse = (c0 + rough * (c1 + rough * c2)) * wi.z * dr.inv_pi / self._density(world)
        return self._rays(world, row, first, (0, 1, 2), (diffuse, *self._reflected(world, wi, wo, h, row)))

    def along_normals(self, first: int) -> Rays:
        """`specular` rays of every row, mirrored at its visible normals."""
        lane = dr.arange(mi.UInt32, self.count * self.specular)
        row = lane % self.count
        wo, shift = self._take(self.cache.wo, row), self._take(self.cache.shift, row)
        sample = point(lane // self.count, dr.opaque(mi.UInt32, max(self.specular, 1)), shift)
        h = visible_normal(wo, dr.gather(mi.Float, self._alpha, row), sample)
        wi = mi.reflect(wo, h)
        world = mi.Frame3f(self._take(self.cache.normal, row)).to_world(wi)
        weights = (dr.select(wi.z > 0, w, 0) for w in self._reflected(world, wi, wo, h, row))
        return self._rays(world, row, first, (1, 2), tuple(weights))

    def _texel(self, lane: Any) -> Any:
        """The direction of each lane: texel after texel, and in each all rows."""
        number, row = lane // self.count, lane % self.count
        texel, part = number // self.per_texel, number % self.per_texel
        height, width = self.shape
        shift = self._take(self.cache.shift, row)
        u, v = (dr.fma(mi.sample_tea_float32(lane, salt), 1, s) for salt, s in ((1, shift.x), (2, shift.y)))
        u, v = u - dr.floor(u), (mi.Float(part) + v - dr.floor(v)) / self.per_texel
        above, below = (dr.cos(mi.Float(texel // width + k) * (dr.pi / height)) for k in (0, 1))
        y = dr.lerp(above, below, u)
        azimuth = ((mi.Float(texel % width) + v) / width - 0.5) * dr.two_pi
        flat = dr.safe_sqrt(1 - y * y)
        sin, cos = dr.sincos(azimuth)
        return mi.Vector3f(flat * sin, y, -flat * cos)

    def _density(self, world: Any) -> Any:
        """Rays through texels in a unit of solid angle, by direction."""
        height, width = self.shape
        row = dr.clip(dr.floor(dr.safe_acos(world.y) * (height / dr.pi)), 0, height - 1)
        y = dr.cos(row * (dr.pi / height)) - dr.cos((row + 1) * (dr.pi / height))
        return self.per_texel * width / (dr.two_pi * dr.maximum(y, 1e-9))

    def _reflected(self, world: Any, wi: Any, wo: Any, h: Any, row: Any) -> tuple[Any, Any]:
        """What `C_0` multiplies of the specular lobe, and the rest, for rays of either kind."""
        alpha = dr.gather(mi.Float, self._alpha, row)
        along = ggx(h, alpha) * smith_g1(wo.z, alpha) / (4 * dr.maximum(wo.z, 1e-4))  # density of mirrored rays
        value = smith_g1(wi.z, alpha) * along / (self._density(world) + self.specular * along)
        fresnel = schlick(dr.dot(h, wo))
        return (1 - fresnel) * value, fresnel * value

    def _rays(self, world: Any, row: Any, first: int, lobes: tuple[int, ...], weights: tuple[Any, ...]) -> Rays:
        cache = self.cache
        origin = self._take(cache.position, row), self._take(cache.geometric_normal, row)
        ray = spawn(*origin, lifted(world, self._take(cache.face, row)))
        dr.eval(ray, row, *weights)
        return Rays(ray, np.array(row).astype(np.int64) + first, lobes, weights)

    def _take(self, values: Any, row: Any) -> Any:
        return dr.gather(type(values), values, dr.gather(mi.UInt32, self._rows, row))
