"""Joint filtering of the transport tables: neighbours on one surface share their samples.

Each pixel of a TILE x TILE block holds another part of one point set, so that a box of that size, restricted to the
same surface by normal and plane distance, has all of it. Radius and normal tolerance follow the lobe: mirror-like
levels keep their detail.
"""

from dataclasses import dataclass
from functools import cached_property

import torch

from materialist.buffers import placed
from materialist.transport.cache import Tables, TransportCache

_TAPS = (0.5, 1.0, 1.0, 1.0, 0.5)
"""5-tap box of width TILE."""
_SHARPNESS = 32.0
"""Power of the cosine between normals (by eye)."""
_SMOOTHED = 0.2
"""Least roughness of a level that is filtered (by eye)."""


@dataclass(frozen=True)
class Guide:
    """Surface of each pixel of the image grid; torch float32."""

    position: torch.Tensor
    """[H, W, 3] camera frame."""
    normal: torch.Tensor
    """[H, W, 3] unit shading normal; zero where there is no surface."""
    scale: torch.Tensor
    """[H, W] size of a pixel on the surface, scene units."""

    def alike(self, dy: int, dx: int) -> torch.Tensor:
        """[H, W] similarity in [0, 1] of every pixel to its neighbour at (dy, dx); 0 beyond the frame."""
        normal, position = _shifted(self.normal, dy, dx), _shifted(self.position, dy, dx)
        cosine = (self.normal * normal).sum(-1).clamp(0, 1)
        away = (self.normal * (position - self.position)).sum(-1).abs() / (self.scale * (1 + dy * dy + dx * dx) ** 0.5)
        return cosine.pow(_SHARPNESS) * torch.exp(-0.5 * away * away)

    @cached_property
    def taps(self) -> list[tuple[int, int, torch.Tensor]]:
        """(rows, columns) to the 5 x 5 neighbours, and the weight [H, W] that each has for each pixel."""
        offsets = list(enumerate(_TAPS, -2))
        return [(dy, dx, wy * wx * self.alike(dy, dx)) for dy, wy in offsets for dx, wx in offsets]


def joint_filter(values: torch.Tensor, guide: Guide) -> torch.Tensor:
    """Average `values` [H, W, C] over neighbours that lie on the same surface."""
    total, norm = torch.zeros_like(values), values.new_zeros(values.shape[:2])
    for dy, dx, weight in guide.taps:
        total.addcmul_(_shifted(values, dy, dx), weight[..., None])
        norm += weight
    return total / norm.clamp_min(1e-6)[..., None]


def _shifted(image: torch.Tensor, dy: int, dx: int) -> torch.Tensor:
    """`image` [H, W, ...] with every pixel replaced by its neighbour at (dy, dx); zero beyond the frame."""
    out = torch.zeros_like(image)
    h, w = image.shape[:2]
    if abs(dy) >= h or abs(dx) >= w:
        return out
    ys, xs = slice(max(0, -dy), min(h, h - dy)), slice(max(0, -dx), min(w, w - dx))
    yd, xd = slice(max(0, dy), min(h, h + dy)), slice(max(0, dx), min(w, w + dx))
    out[ys, xs] = image[yd, xd]
    return out


def filter_tables(cache: TransportCache, tables: Tables, guide: Guide) -> Tables:
    """The tables with the diffuse lobe and the specular levels wider than a pixel's neighbourhood filtered."""
    # Sharper levels are nearly noise-free and carry reflected detail.
    wide = [roughness[:, None] >= _SMOOTHED for roughness in cache.roughness]
    some = [k for k, pixels in enumerate(wide) if pixels.any()]
    stack = torch.cat([tables.diffuse, *(tables.specular[k] for k in some)], -1)
    grid = stack.new_zeros(guide.scale.numel(), stack.shape[1])
    pixels = torch.from_numpy(cache.pixels.astype("int64"))
    grid[pixels] = stack
    smooth = joint_filter(grid.view(*guide.scale.shape, -1), guide).view(len(grid), -1)[pixels]
    levels = list(tables.specular)
    for k, values in zip(some, smooth[:, 9:].split(6, -1), strict=True):
        levels[k] = torch.where(placed(wide[k]), values, levels[k])
    return Tables(smooth[:, :9].contiguous(), torch.stack(levels))
