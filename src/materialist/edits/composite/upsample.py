"""Layers of working size brought to the photo's native size along the photo's own edges."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from materialist.color import linear_to_srgb
from materialist.types import Array


@dataclass(frozen=True)
class UpsampleSettings:
    """Joint bilateral upsampling: standard deviations; tuned by eye."""

    colour: float = 0.06  # of the colour weight, sRGB-encoded: about a just visible step
    strip: int = 128  # native rows handled at a time; derived: memory
    radius: float = 0.8  # of the spatial weight, working pixels, over 4 x 4 of them


UPSAMPLE = UpsampleSettings()


def strips(height: int, size: int = UPSAMPLE.strip, start: int = 0) -> Iterator[slice]:
    """Slices of at most `size` rows that cover `height` rows, from `start` on."""
    return (slice(top, min(top + size, height)) for top in range(start, height, size))


class GuidedUpsample:
    """Joint bilateral upsampling (Kopf et al. 2007) of layers [H, W, C] to the size [H0, W0] of a photo.

    Each native pixel takes the mean of the 4 x 4 working pixels around it, weighted by distance and by how alike two
    pictures look there at working size (`guide` [H, W, 3] linear) and here at native size. At equal sizes the layer
    stays as it is.
    """

    def __init__(self, layer: Array, guide: Array, native: tuple[int, ...]):
        self.layer = layer
        self.guide = linear_to_srgb(guide)
        self.native = native

    def __call__(self, rows: slice, columns: slice, colours: Array) -> Array:
        """[h, w, C] float32: the layer in a native window that has those colours [h, w, 3] linear."""
        working = self.layer.shape[:2]
        if working == self.native:
            return self.layer[rows, columns].astype(np.float32)
        # --- The four working rows and columns around each native pixel, and their weights ---
        here = linear_to_srgb(colours)
        y0, ys = _taps(
            np.arange(rows.start, rows.stop), self.native[0], working[0], UPSAMPLE.radius
        )
        x0, xs = _taps(
            np.arange(self.native[1])[columns], self.native[1], working[1], UPSAMPLE.radius
        )
        # --- The mean over these 16, weighted by distance and likeness ---
        total = np.zeros((*here.shape[:2], self.layer.shape[2]), np.float32)
        norm = np.zeros(here.shape[:2], np.float32)
        for i in range(4):
            for row in np.unique(y0[i]):
                # The native rows that look up this working row.
                band = slice(*np.searchsorted(y0[i], (row, row + 1)))
                for j in range(4):
                    away = here[band] - self.guide[row, x0[j]]
                    away = np.einsum("ijk,ijk->ij", away, away)
                    # The small constant keeps a mean of the neighbourhood where nothing there looks alike.
                    weight = np.exp(-0.5 / UPSAMPLE.colour**2 * away) + 1e-4
                    weight *= ys[i][band, None] * xs[j]
                    total[band] += weight[..., None] * self.layer[row, x0[j]]
                    norm[band] += weight
        return total / norm[..., None]


def _taps(index: Array, native: int, working: int, radius: float) -> tuple[Array, Array]:
    """The four working positions [4, n] around native positions [n] of one axis, and their spatial weights [4, n]."""
    # Pixel centres lie at half numbers.
    place = (index + 0.5) * working / native - 0.5
    base = np.floor(place).astype(np.int64)
    taps = base[None] + np.arange(-1, 3)[:, None]
    weights = np.exp(-0.5 * ((taps - place[None]) / radius) ** 2).astype(np.float32)
    return np.clip(taps, 0, working - 1), weights
