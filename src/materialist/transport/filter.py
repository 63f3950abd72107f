"""Joint filtering of the transport tables: neighbours on one surface share their samples.

Each pixel of a TILE x TILE block holds another part of one point set, so that a box of that size, restricted to the
same surface by normal and plane distance, has all of it. Radius and normal tolerance follow the lobe: mirror-like
levels keep their detail.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from scipy.sparse import csr_array

from materialist.buffers import placed
from materialist.transport.cache import Tables, TransportCache
from materialist.types import Array

_TAPS = (0.5, 1.0, 1.0, 1.0, 0.5)
"""5-tap box of width TILE."""
_NORMAL_SQUARINGS = 5
"""How often the cosine between normals is squared: its power is 32 (by eye)."""
MIN_ROUGHNESS = 0.2
"""Least roughness of a level that is filtered (by eye)."""
_MIN_WEIGHT = 1e-4
"""Weight of a neighbour below which it is left out (derived: time)."""
_STRIP_ROWS = 32
"""Rows whose neighbours are weighed at once (derived: time, as what is computed of them stays in the cache)."""


@dataclass(frozen=True)
class Guide:
    """Surface of each pixel of the image grid; float32."""

    position: Array
    """[H, W, 3] camera frame."""
    normal: Array
    """[H, W, 3] unit shading normal; zero where there is no surface."""
    scale: Array
    """[H, W] size of a pixel on the surface, scene units."""

    def alike(self, dy: int, dx: int, rows: slice) -> Array:
        """[h, W] similarity in [0, 1] of pixels to their neighbours at (dy, dx); 0 beyond the frame."""
        normal = self.normal[rows]
        offset = self._shifted("position", dy, dx, rows) - self.position[rows]
        cosine = np.einsum("hwk,hwk->hw", normal, self._shifted("normal", dy, dx, rows))
        power = np.clip(cosine, 0, 1)
        for _ in range(_NORMAL_SQUARINGS):
            power *= power
        # Distance of the neighbour from the pixel's tangent plane, in pixel sizes.
        away = np.einsum("hwk,hwk->hw", normal, offset)
        away /= self.scale[rows] * math.sqrt(1 + dy * dy + dx * dx)
        return power * np.exp(-0.5 * away * away)

    @cached_property
    def _padded(self) -> dict[str, Array]:
        """Both maps with zeros beyond the frame, as far as the taps reach."""
        reach = len(_TAPS) // 2
        sides = [(reach, reach), (reach, reach), (0, 0)]
        return {name: np.pad(getattr(self, name), sides) for name in ("position", "normal")}

    def _shifted(self, name: str, dy: int, dx: int, rows: slice) -> Array:
        """[h, W, 3] some rows of a map, every pixel replaced by its neighbour at (dy, dx); zero beyond the frame."""
        w = self.scale.shape[1]
        reach = len(_TAPS) // 2
        first = reach + dx
        return self._padded[name][
            rows.start + reach + dy : rows.stop + reach + dy, first : first + w
        ]

    @cached_property
    def mean(self) -> csr_array:
        """[H W, H W]: times values of all pixels, their means over the 5 x 5 neighbours on the same surface."""
        h, w = self.scale.shape
        # --- The 25 taps: step in rows and columns, and weight of the box ---
        taps = [
            (dy, dx, wy * wx) for dy, wy in enumerate(_TAPS, -2) for dx, wx in enumerate(_TAPS, -2)
        ]
        steps = np.array([dy * w + dx for dy, dx, _ in taps], np.int32)
        # --- Weights, some rows at a time: the box, times how alike both surfaces are ---
        parts = []
        for first in range(0, h, _STRIP_ROWS):
            rows = slice(first, min(first + _STRIP_ROWS, h))
            weight = np.stack(
                [share * self.alike(dy, dx, rows).ravel() for dy, dx, share in taps], -1
            )
            # A mean: the weights of the neighbours of each pixel sum to 1.
            weight /= np.maximum(weight.sum(-1, keepdims=True), 1e-6)
            column = np.arange(first * w, rows.stop * w, dtype=np.int32)[:, None] + steps
            kept = weight > _MIN_WEIGHT
            parts.append((weight[kept], column[kept], kept.sum(-1, dtype=np.int32)))
        # --- One sparse matrix by rows: weights, columns, and where each row ends ---
        weight, column, count = (np.concatenate(part) for part in zip(*parts, strict=True))
        ends = np.concatenate([[0], count.cumsum()]).astype(np.int32)
        return csr_array((weight, column, ends), shape=(h * w, h * w))


def surface_guide(cache: TransportCache) -> Guide:
    """Of the surfaces that the cache's camera sees."""
    position = np.array(cache.position).T
    # At depth z a pixel is z / f wide, f the focal length in pixels.
    scale = cache.image(-position[:, 2:] / cache.camera.focal)[..., 0]
    normal = np.array(cache.normal).T
    return Guide(cache.image(position), cache.image(normal), np.maximum(scale, 1e-9))


def joint_filter(values: torch.Tensor, guide: Guide) -> torch.Tensor:
    """Average `values` [H, W, C] over neighbours that lie on the same surface."""
    flat = values.flatten(0, 1).cpu().numpy()
    return placed(guide.mean @ flat).view(values.shape)


def filter_tables(
    cache: TransportCache, tables: Tables, guide: Guide, *, sharpest: float = MIN_ROUGHNESS
) -> Tables:
    """The tables with the diffuse lobe and the specular levels from the roughness `sharpest` on filtered."""
    # Sharper levels are nearly noise-free and carry reflected detail.
    wide = [roughness[:, None] >= sharpest for roughness in tables.levels]
    filtered = [k for k, pixels in enumerate(wide) if pixels.any()]
    # --- All tables that are filtered, side by side on the image grid: one product filters them ---
    stack = torch.cat([tables.diffuse, *(tables.specular[k] for k in filtered)], -1)
    grid = stack.new_zeros(guide.scale.size, stack.shape[1])
    pixels = torch.from_numpy(cache.pixels.astype("int64"))
    grid[pixels] = stack
    smooth = joint_filter(grid.view(*guide.scale.shape, -1), guide).view(len(grid), -1)[pixels]
    # --- Back into the tables: 9 diffuse channels, then 6 a level ---
    levels = list(tables.specular)
    for n, k in enumerate(filtered):  # none where every pixel is nearly a mirror
        first = 9 + 6 * n
        levels[k] = torch.where(placed(wide[k]), smooth[:, first : first + 6], levels[k])
    return Tables(smooth[:, :9].contiguous(), torch.stack(levels), tables.levels)
