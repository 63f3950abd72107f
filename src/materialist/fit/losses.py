"""Losses of the fit; torch tensors, any shape that broadcasts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from materialist.fit.settings import Encoding, MaterialSettings
from materialist.types import Array

CLIPPED = 0.99
"""Linear value from which a channel of an ordinary photo counts as clipped: the true radiance may be higher."""


def encode(radiance: torch.Tensor, encoding: Encoding) -> torch.Tensor:
    """Radiance as the loss sees it: `linear` (the paper), `srgb` (as an eye sees the photo), `log1p` (HDR appendix)."""
    if encoding == "linear":
        return radiance
    x = radiance.clamp_min(0)
    if encoding == "log1p":
        return torch.log1p(x)
    return torch.where(x <= 0.0031308, 12.92 * x, 1.055 * x.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def residual(radiance: torch.Tensor, photo: torch.Tensor, encoding: Encoding, *, clipped: bool) -> torch.Tensor:
    """Encoded rendering minus encoded photo, [..., 3]; with `clipped`, no error above a clipped channel."""
    error = encode(radiance, encoding) - encode(photo, encoding)
    return torch.where(photo >= CLIPPED, error.clamp_max(0), error) if clipped else error


def l1_l2(error: torch.Tensor) -> torch.Tensor:
    """L_re = L_1 + L_2 (paper, Progressive Differentiable Rendering)."""
    return error.abs().mean() + error.square().mean()


def loss_weights(prior: torch.Tensor, settings: MaterialSettings) -> torch.Tensor:
    """[P, 5] weights of |change| in delta L_cons, for each value of the prior [P, 5].

    Metallic weighs more where the prior is sure of a dielectric.
    """
    rows = settings.delta * per_value(settings.weights).repeat(len(prior), 1)
    rows[:, 4] *= metal_factor(prior, settings)
    return rows


def per_value(weights: tuple[float, float, float]) -> torch.Tensor:
    """[5] for the values of a pixel, of weights of albedo (the mean over its channels), roughness and metallic."""
    albedo, roughness, metallic = weights
    return torch.tensor([albedo / 3] * 3 + [roughness, metallic], dtype=torch.float32)


def metal_factor(prior: torch.Tensor, settings: MaterialSettings) -> torch.Tensor:
    """[P] factor on the weight of metallic, by the prior [P, 5]: `settings.metal_factor` at 0, falling to 1."""
    return 1 + (settings.metal_factor - 1) * fall_off(prior[:, 4], settings.surely_below)


def fall_off(values: torch.Tensor, limit: float) -> torch.Tensor:
    """1 at 0, falling linearly to 0 at the limit."""
    return 1 - (values / limit).clamp(0, 1)


def consistency(maps: torch.Tensor, prior: torch.Tensor, weights: torch.Tensor) -> torch.Tensor:
    """delta L_cons: mean over pixels of the weighted L1 distance of maps [P, 5] to the prior [P, 5]."""
    return ((maps - prior).abs() * weights).sum(1).mean()


def log_total_variation(log_map: torch.Tensor, weight: torch.Tensor | None = None) -> torch.Tensor:
    """Mean absolute difference of neighbouring texels of a log-radiance map [h, w, 3], wrapped in azimuth.

    weight: [h, w]; a difference counts as much as the heavier of its two texels.
    """
    down, right = (log_map[1:] - log_map[:-1]).abs(), (log_map - log_map.roll(1, 1)).abs()
    if weight is not None:
        down = down * torch.maximum(weight[1:], weight[:-1])[..., None]
        right = right * torch.maximum(weight, weight.roll(1, 1))[..., None]
    return down.mean() + right.mean()


def log_chroma(log_map: torch.Tensor) -> torch.Tensor:
    """Mean absolute deviation of log radiance [..., 3] from grey: most lights are nearly white."""
    return (log_map - log_map.mean(-1, keepdim=True)).abs().mean()


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
