"""The light matrix of a scene whose walls may end anywhere beyond the picture: traced once, asked for any ends.

Rays are followed through the continuations of walls to what stands behind them. For given ends, each ray meets the
first of those that is still there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch

from materialist.buffers import integers
from materialist.geometry.extents import PlaneExtent, axes
from materialist.transport.cache import MISS, TransportCache
from materialist.transport.light import (
    LightMatrix,
    add_footprints,
    add_to_map,
    bilinear,
    flat,
    openness,
    per_texel,
)
from materialist.transport.rays import Rays, rays
from materialist.types import Array, Camera, Materials, Mesh

LAYERS = 4
"""Continued walls that a ray is followed through."""
SPHERE_SAMPLES = 1024
SPECULAR_SAMPLES = 32


@dataclass(frozen=True)
class _Rays:
    """Rays [N] of one kind that leave Q rows."""

    row: Array
    """[N]."""
    weights: tuple[Array, Array]
    """Each [N]: what the albedo multiplies, and the rest."""
    diffuse: Array | None
    """[N] weight in the diffuse lobe, where the rays are part of it."""
    index: Array
    """[N, 4] texels of the direction, and their shares."""
    share: Array
    layers: tuple[tuple[Array, Array, Array, Array], ...]
    """Per layer: wall [N] (-1: none), its coordinates x [N] and y [N], and the radiance slot [N] there."""
    last: Array
    """[N] uint32 slot of what is behind all of them, or MISS."""

    def picked(self, these: Array) -> _Rays:
        layers = tuple((w[these], x[these], y[these], s[these]) for w, x, y, s in self.layers)
        diffuse = None if self.diffuse is None else self.diffuse[these]
        return _Rays(self.row[these], (self.weights[0][these], self.weights[1][these]), diffuse, self.index[these],
                     self.share[these], layers, self.last[these])  # fmt: skip

    def met(self, ends: Sequence[PlaneExtent]) -> Array:
        """[N] uint32 slot that each ray meets, or MISS, where wall k ends as ends[k] says."""
        slot = self.last.copy()
        for wall, x, y, there in reversed(self.layers):
            for k, end in enumerate(ends):
                slot = np.where((wall == k) & end.holds(x, y), there, slot)
        return slot


class WallMatrix:
    """Transport of the surface pixels `cache.pixels[rows]` for envmaps of `height` rows, and for any ends of walls.

    Args:
        cache: of a mesh whose walls go on as far as any of the ends.
        walls: normal [3] and number of the plane of each wall.
        slot_radiance: [S, 3] what leaves the surfaces (`cache.slot_radiance`).
    """

    def __init__(
        self, cache: TransportCache, materials: Materials, rows: Array, height: int,
        walls: Sequence[tuple[Array, int]], slot_radiance: Array,
    ):  # fmt: skip
        self.pixels = cache.pixels[rows]
        self.shape = (height, 2 * height)
        rough, metallic, albedo = (m[self.pixels] for m in flat(materials))
        self._albedo = torch.from_numpy(albedo.astype(np.float32))
        self._light = torch.from_numpy(np.ascontiguousarray(slot_radiance, np.float32))
        wall = _beyond(cache.mesh, cache.camera, [k for _, k in walls])
        basis = [axes(normal) for normal, _ in walls]
        each_texel = per_texel(SPHERE_SAMPLES, height)
        traced = rays(cache, rows, rough, metallic, self.shape, each_texel, SPECULAR_SAMPLES)
        every = [_followed(cache, some, wall, basis, self.shape) for some in traced]
        size = height * 2 * height
        self._fixed = (
            torch.zeros(2, len(rows), size), torch.zeros(2, len(rows), 3), torch.zeros(size)
        )  # fmt: skip
        self._open = []
        faced = torch.zeros(size)
        for each in every:
            through = np.logical_or.reduce([w >= 0 for w, *_ in each.layers]) if each.layers else each.last < 0
            self._add(self._fixed, each.picked(~through), ())
            self._open.append(each.picked(through))
            if each.diffuse is not None:
                add_to_map(faced, each.index, each.share, each.diffuse)
        self._faced = faced

    def ended(self, ends: Sequence[PlaneExtent]) -> tuple[LightMatrix, torch.Tensor]:
        """The matrix, and [2, Q, 3] what arrives by way of other surfaces, where wall k ends as ends[k] says."""
        totals = tuple(t.clone() for t in self._fixed)
        for each in self._open:
            self._add(totals, each, ends)
        parts, indirect, free = totals
        nothing = torch.zeros((2, 0), dtype=torch.int64), torch.zeros((0, 2))
        matrix = LightMatrix(
            torch.from_numpy(self.pixels.astype(np.int64)), self.shape, parts, *nothing, self._albedo,
            openness(free, self._faced),
        )  # fmt: skip
        return matrix, indirect

    def _add(self, totals: tuple[torch.Tensor, ...], each: _Rays, ends: Sequence[PlaneExtent]) -> None:
        """What rays bring, added to both parts, the light by way of surfaces, and what is open."""
        parts, indirect, free = totals
        slot = each.met(ends)
        missed = slot == MISS
        light = self._light[torch.from_numpy(slot[~missed].astype(np.int64))]
        row = torch.from_numpy(each.row[~missed])
        index, share = each.index[missed], each.share[missed]
        for part, by_surfaces, weight in zip(parts, indirect, each.weights, strict=True):
            add_footprints(part, index, share, weight[missed], each.row[missed])
            by_surfaces.index_add_(0, row, light * torch.from_numpy(weight[~missed])[:, None])
        if each.diffuse is not None:
            add_to_map(free, index, share, each.diffuse[missed])


def _followed(
    cache: TransportCache, some: Rays, wall: Array, basis: list[Array], shape: tuple[int, int]
) -> _Rays:  # fmt: skip
    """Rays through the walls that the faces [F] belong to (-1: none)."""
    scene: Any = cache.scene
    of_face = integers(mi, (wall + 1).astype(np.uint32))
    ray, active = some.ray, mi.Bool(True)
    direction = np.array(ray.d).T
    layers, last = [], np.full(len(direction), MISS, np.uint32)
    for _ in range(LAYERS + 1):
        pi = scene.ray_intersect_preliminary(ray, coherent=False, active=active)
        hit = active & pi.is_valid()
        here = dr.select(hit, dr.gather(mi.UInt32, of_face, pi.prim_index, hit), 0)
        slot = dr.select(hit, dr.gather(mi.UInt32, cache._slots, pi.prim_index, hit), mi.UInt32(MISS))
        end = ray.o + ray.d * dr.select(hit, pi.t, 0)
        dr.eval(here, slot, end, hit)
        number, where = np.array(here).astype(np.int64) - 1, np.array(slot)
        stopped = np.array(active) & (number < 0)
        last[stopped] = where[stopped]
        if not (number >= 0).any():
            break
        place = np.zeros((len(number), 2))
        for k, pair in enumerate(basis):
            mine = number == k
            place[mine] = np.array(end).T[mine] @ pair.T
        layers.append((number, place[:, 0], place[:, 1], where))
        active = hit & (here > 0)
        ray = mi.Ray3f(end + ray.d * (1e-4 * (1 + dr.max(dr.abs(end)))), ray.d)
    index, share = bilinear(direction, shape)
    return _Rays(
        some.row, some.weights, some.diffuse, index, share.astype(np.float32), tuple(layers), last
    )  # fmt: skip


def _beyond(mesh: Mesh, camera: Camera, planes: list[int]) -> Array:
    """[F] which of the planes' continuations beyond the picture a face is part of, -1: of none."""
    wall = np.full(len(mesh.faces), -1, np.int64)
    middle = mesh.vertices[mesh.faces].mean(1, dtype=np.float64)
    half = np.array([camera.width, camera.height]) / (2 * camera.focal)
    x, y, z = middle.T
    outside = (z >= 0) | (np.abs(x) > -z * half[0]) | (np.abs(y) > -z * half[1])
    for number, k in enumerate(planes):
        wall[(mesh.face_plane == k) & outside] = number
    return wall
