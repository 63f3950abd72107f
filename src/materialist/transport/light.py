"""Light is linear: with materials fixed, the radiance of a pixel is `T E + b`, for an envmap E of few texels.

T is stored for a subset of pixels at the resolution of the fit; b is what arrives from other surfaces.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import torch

from materialist.buffers import placed
from materialist.envmap import texels_around
from materialist.transport.cache import MISS, TransportCache
from materialist.transport.rays import LobeRays
from materialist.types import Array, Materials


@dataclass(frozen=True)
class LightMatrix:
    """Radiance of Q pixels as a linear function of an envmap with h x 2h texels; float32, on `buffers.torch_device()`.

    Everything comes in two parts: what the albedo multiplies, and the rest.
    """

    pixels: torch.Tensor
    """[Q] int64 row-major pixel indices, on the CPU."""
    shape: tuple[int, int]
    """(h, 2h) of the envmap."""
    parts: torch.Tensor
    """[2, Q, h * 2h]: direct transport of both."""
    hit_index: torch.Tensor
    """[2, K] int64: (row, radiance slot) of every ray that meets a surface."""
    hit_weight: torch.Tensor
    """[K, 2] weight of each such ray in both."""
    albedo: torch.Tensor
    """[Q, 3]."""

    def direct(self, envmap: torch.Tensor) -> torch.Tensor:
        """[2, Q, 3] light of each part straight from `envmap` [h * 2h, 3]; differentiable in it."""
        return _Product.apply(self.parts.flatten(0, 1), envmap).unflatten(0, (2, -1))

    def indirect(self, slot_radiance: torch.Tensor) -> torch.Tensor:
        """[2, Q, 3] light of each part by way of other surfaces, given what leaves each slot [S, 3]."""
        light = slot_radiance[self.hit_index[1]]
        # A sparse product, row by row: many rays of a row meet few slots.
        sums = light.new_zeros(2, len(self.pixels), 3)
        for part in range(2):
            sums[part].index_add_(0, self.hit_index[0], light * self.hit_weight[:, part : part + 1])
        return sums

    def combine(self, light: torch.Tensor) -> torch.Tensor:
        """Radiance [Q, 3] from the light of the parts [2, Q, 3]."""
        return self.albedo * light[0] + light[1]


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

    sphere_samples: rays of a pixel through the texels of the whole sphere, equally many through each and at least
        one (half of them leave below the surface, and are not traced).
    specular_samples: further rays of a pixel along its specular lobe.
    """
    pixels = cache.pixels[rows]
    # --- Materials of the chosen pixels ---
    maps = materials.roughness, materials.metallic, materials.albedo
    rough, metallic, albedo = (values.reshape(-1, *values.shape[2:])[pixels] for values in maps)
    shape = (height, 2 * height)

    # --- Trace all rays, some rows at a time ---
    per_texel = max(1, round(sphere_samples / (2 * height * height)))
    scene: Any = cache.scene
    parts = torch.zeros(2, len(rows), height * 2 * height)
    hits = []
    for batch in LobeRays(cache, rows, rough, metallic, shape, per_texel, specular_samples).parts():
        pi = scene.ray_intersect_preliminary(batch.ray, coherent=False)
        slots_met = dr.gather(mi.UInt32, cache.slots, pi.prim_index, pi.is_valid())
        slot = np.array(dr.select(pi.is_valid(), slots_met, MISS))  # [N] radiance slot of each ray
        # Rays that leave the scene fill T (of T E + b), those that hit a surface give b.
        leaves = slot == MISS
        index, share = texels_around(np.array(batch.ray.d).T[leaves], shape)
        for part, weight in zip(parts, batch.weights, strict=True):
            add_footprints(part, index, share, weight[leaves], batch.row[leaves])
        hits.append((batch.row[~leaves], slot[~leaves], np.stack(batch.weights, -1)[~leaves]))

    # --- One list of the rays that hit a surface ---
    row, slots, hit_weight = (placed(np.concatenate(h)) for h in zip(*hits, strict=True))
    return LightMatrix(
        torch.from_numpy(pixels.astype(np.int64)),
        shape,
        placed(parts),
        torch.stack([row, slots.long()]),
        hit_weight,
        placed(albedo.astype(np.float32)),
    )


def add_footprints(
    out: torch.Tensor, index: Array, share: Array, weight: Array, row: Array
) -> None:
    """Add rays [N] to their rows [N] of out [rows, texels]: their weight [N] to the texels index by share [N, 4]."""
    flat = row[:, None] * out.shape[-1] + index
    values = (share * weight[:, None]).astype(np.float32)
    out.view(-1).index_add_(0, torch.from_numpy(flat.ravel()), torch.from_numpy(values.ravel()))
