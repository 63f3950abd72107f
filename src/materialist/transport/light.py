"""Light is linear: with materials fixed, the radiance of a pixel is `T E + b`, for an envmap E of few texels.

T is stored for a subset of pixels at the resolution of the fit; b is what arrives from other surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch

from materialist.transport.cache import MISS, TransportCache
from materialist.transport.rays import rays
from materialist.types import Array, Materials

DIELECTRIC_R0 = 0.04
"""Fresnel reflectance R_0 of a dielectric with IOR 1.5 at normal incidence."""


@dataclass(frozen=True)
class LightMatrix:
    """Radiance of Q pixels as a linear function of an envmap with h x 2h texels; torch float32.

    Everything comes in three lobes: diffuse (without A (1 - M)), the part of the specular lobe that C_0 multiplies,
    and the rest of the specular lobe.
    """

    pixels: torch.Tensor
    """[Q] int64 row-major pixel indices."""
    shape: tuple[int, int]
    """(h, 2h) of the envmap."""
    lobes: torch.Tensor
    """[3, Q, h * 2h]: direct transport of the lobes."""
    hit_index: torch.Tensor
    """[2, K] int64: (row, radiance slot) of every ray that meets a surface."""
    hit_weight: torch.Tensor
    """[K, 3] weight of each such ray in the three lobes."""
    albedo: torch.Tensor
    """[Q, 3]."""
    metallic: torch.Tensor
    """[Q, 1]."""
    open: torch.Tensor
    """[h * 2h] in [0, 1]: share of the light that each texel would send to the pixels that nothing holds back; 1 for
    texels that no pixel faces."""

    def direct(self, envmap: torch.Tensor) -> torch.Tensor:
        """[3, Q, 3] light of each lobe straight from `envmap` [h * 2h, 3]; differentiable in it."""
        return _Product.apply(self.lobes.flatten(0, 1), envmap).unflatten(0, (3, -1))

    def indirect(self, slot_radiance: torch.Tensor) -> torch.Tensor:
        """[3, Q, 3] light of each lobe by way of other surfaces, given what leaves each slot [S, 3]."""
        light = slot_radiance[self.hit_index[1]]
        sums = torch.zeros(3, len(self.pixels), 3)
        for lobe in range(3):
            sums[lobe].index_add_(0, self.hit_index[0], light * self.hit_weight[:, lobe : lobe + 1])
        return sums

    def combine(self, light: torch.Tensor, albedo: torch.Tensor | None = None) -> torch.Tensor:
        """Radiance [Q, 3] from the light of the lobes [3, Q, 3], with another albedo [Q, 3] if one is given."""
        a, m = self.albedo if albedo is None else albedo, self.metallic
        return a * (1 - m) * light[0] + (DIELECTRIC_R0 * (1 - m) + m * a) * light[1] + light[2]

    def per_channel(self) -> torch.Tensor:
        """[3, Q, h * 2h] direct transport of red, green and blue, the lobes combined."""
        return torch.stack([self.combine(self.lobes, self.albedo[:, c : c + 1]) for c in range(3)])


class _Product(torch.autograd.Function):
    """matrix [N, T] @ light [T, 3], differentiable in the light.

    The gradient is taken with the matrix as it lies in memory: its transpose times a few columns is six times as slow.
    """

    @staticmethod
    def forward(ctx, matrix: torch.Tensor, light: torch.Tensor) -> torch.Tensor:
        ctx.save_for_backward(matrix)
        return matrix @ light

    @staticmethod
    def backward(ctx, grad: torch.Tensor):
        (matrix,) = ctx.saved_tensors
        return None, (grad.t() @ matrix).t()


def light_matrix(
    cache: TransportCache,
    materials: Materials,
    rows: Array,
    height: int,
    *,
    sphere_samples: int = 1024,
    specular_samples: int = 64,
) -> LightMatrix:
    """Trace the transport matrix of the surface pixels `cache.pixels[rows]` for envmaps of `height` rows.

    Args:
        sphere_samples: rays of a pixel through the texels of the whole sphere, equally many through each and at least
            one (half of them leave below the surface, and are not traced).
        specular_samples: further rays of a pixel along its specular lobe.
    """
    pixels = cache.pixels[rows]
    rough = materials.roughness.reshape(-1)[pixels]
    albedo, metallic = materials.albedo.reshape(-1, 3)[pixels], materials.metallic.reshape(-1, 1)[pixels]
    shape = (height, 2 * height)
    lobes = torch.zeros(3, len(rows), height * 2 * height)
    faced = torch.zeros(height * 2 * height)
    hits = []
    for some in rays(cache, rows, rough, shape, per_texel(sphere_samples, height), specular_samples):
        direction, slot = np.array(some.ray.d).T, met(cache, some.ray)
        index, share = bilinear(direction, shape)
        weights = [np.array(w) for w in some.weights]
        free = slot == MISS
        for lobe, weight in zip(some.lobes, weights, strict=True):
            add_footprints(lobes[lobe], index[free], share[free], weight[free], some.row[free])
            if lobe == 0:
                add_footprints(faced, index, share, weight, np.zeros_like(some.row))
        hits.append(_hits(slot[~free], some.row[~free], [w[~free] for w in weights], some.lobes))
    index = np.concatenate([h[0] for h in hits], 1)
    weight = np.concatenate([h[1] for h in hits])
    return LightMatrix(
        torch.from_numpy(pixels.astype(np.int64)), shape, lobes, torch.from_numpy(index), torch.from_numpy(weight),
        torch.from_numpy(albedo.astype(np.float32)), torch.from_numpy(metallic.astype(np.float32)),
        torch.where(faced > 0, lobes[0].sum(0) / faced.clamp_min(1e-12), 1.0),
    )  # fmt: skip


def per_texel(samples: int, height: int) -> int:
    """Rays through each texel of a map of so many rows, for so many over the sphere."""
    return max(1, round(samples / (2 * height * height)))


def met(cache: TransportCache, ray: Any) -> Array:
    """[N] uint32 radiance slot that each ray meets, or MISS."""
    scene: Any = cache.scene
    pi = scene.ray_intersect_preliminary(ray, coherent=False)
    return np.array(dr.select(pi.is_valid(), dr.gather(mi.UInt32, cache._slots, pi.prim_index, pi.is_valid()), MISS))


def add_footprints(out: torch.Tensor, index: Array, share: Array, weight: Array, row: Array) -> None:
    """Add rays [N] to out [rows, texels], or [texels]: their weight [N] to the texels index [N, 4] by share [N, 4]."""
    flat = row[:, None] * out.shape[-1] + index
    values = (share * weight[:, None]).astype(np.float32)
    out.view(-1).index_add_(0, torch.from_numpy(flat.ravel()), torch.from_numpy(values.ravel()))


def _hits(slot: Array, row: Array, weights: list[Array], lobes: tuple[int, ...]) -> tuple[Array, Array]:
    """`hit_index` and `hit_weight` of rays [N] that all meet a surface."""
    columns = np.zeros((len(slot), 3), np.float32)
    for lobe, weight in zip(lobes, weights, strict=True):
        columns[:, lobe] = weight
    return np.stack([row, slot.astype(np.int64)]), columns


def bilinear(direction: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """The four texels ([N, 4] flat index) around unit directions [N, 3] in an [h, w] map, and their shares [N, 4]."""
    h, w = shape
    x = (np.arctan2(direction[:, 0], -direction[:, 2]) / (2 * np.pi) + 0.5) * w - 0.5
    y = np.clip(np.arccos(np.clip(direction[:, 1], -1, 1)) / np.pi * h - 0.5, 0, h - 1)
    x0, y0 = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    fx, fy = x - x0, y - y0
    xs, ys = np.stack([x0 % w, (x0 + 1) % w], -1), np.stack([y0, np.minimum(y0 + 1, h - 1)], -1)
    index = ys[:, [0, 0, 1, 1]] * w + xs[:, [0, 1, 0, 1]]
    share = np.stack([(1 - fy) * (1 - fx), (1 - fy) * fx, fy * (1 - fx), fy * fx], -1)
    return index, share
