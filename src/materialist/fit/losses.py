"""Losses of the fit; torch tensors, any shape that broadcasts."""

from __future__ import annotations

import torch

from materialist.fit.settings import Encoding, MaterialSettings

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
