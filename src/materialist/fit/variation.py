"""Edge-aware total variation: how strongly neighbouring surface pixels should change alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from materialist.types import Array


@dataclass(frozen=True)
class EdgeWeights:
    """Weights between vertically and horizontally adjacent pixels: 1 inside a surface, towards 0 across an edge."""

    pixels: torch.Tensor
    """[P] int64 row-major indices of the surface pixels."""
    down: torch.Tensor
    """[H-1, W] weight between (i, j) and (i+1, j); 0 where either has no surface."""
    right: torch.Tensor
    """[H, W-1] weight between (i, j) and (i, j+1)."""

    def total_variation(self, values: torch.Tensor) -> torch.Tensor:
        """[C] mean over surface pixels of the weighted absolute differences of `values` [P, C]."""
        height, width = self.right.shape[0], self.down.shape[1]
        grid = values.new_zeros(height * width, values.shape[1]).index_copy(0, self.pixels, values)
        grid = grid.view(height, width, -1)
        vertical = ((grid[1:] - grid[:-1]).abs() * self.down[..., None]).sum((0, 1))
        horizontal = ((grid[:, 1:] - grid[:, :-1]).abs() * self.right[..., None]).sum((0, 1))
        return (vertical + horizontal) / len(values)


def edge_weights(pixels: Array, guide: Array, *, tolerance: float = 0.1) -> EdgeWeights:
    """Weights for the surface pixels [P] (row-major indices) by the similarity of `guide` [H, W, C].

    The weight is exp(-|difference| / tolerance), |.| the largest channel.
    """
    surface = np.zeros(guide.shape[0] * guide.shape[1], bool)
    surface[pixels] = True
    surface = surface.reshape(guide.shape[:2])

    def weight(a, b) -> torch.Tensor:
        similar = np.exp(-np.abs(guide[a] - guide[b]).max(-1) / tolerance)
        return torch.from_numpy((similar * (surface[a] & surface[b])).astype(np.float32))

    return EdgeWeights(
        torch.from_numpy(np.asarray(pixels, np.int64)),
        weight(np.s_[1:], np.s_[:-1]),
        weight(np.s_[:, 1:], np.s_[:, :-1]),
    )
