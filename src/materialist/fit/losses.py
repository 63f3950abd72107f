"""Losses of the fit; torch tensors, any shape that broadcasts."""

from __future__ import annotations

from typing import Literal

import torch

CLIPPED = 0.99
"""Linear value from which a channel of an ordinary photo counts as clipped: the true radiance may be higher."""

PURE = (1e-3, 0.1)
"""Linear value up to which a channel is black, and that of the brightest channel from which that is no shadow."""

Encoding = Literal["linear", "srgb", "log1p"]


def encode(radiance: torch.Tensor, encoding: Encoding) -> torch.Tensor:
    """Radiance as the loss sees it: `linear` (the paper), `srgb` (as an eye sees the photo), `log1p` (HDR appendix)."""
    if encoding == "linear":
        return radiance
    x = radiance.clamp_min(0)
    if encoding == "log1p":
        return torch.log1p(x)
    return torch.where(x <= 0.0031308, 12.92 * x, 1.055 * x.clamp_min(0.0031308) ** (1 / 2.4) - 0.055)


def too_pure(photo: torch.Tensor) -> torch.Tensor:
    """[..., 3] bool: channels at black in pixels of [..., 3] linear that are not dark.

    Such a colour is purer than the photo's file can hold, and than any surface whose reflection is white shows: the
    channel says how little the albedo has of it, and nothing of light, roughness and metallic.
    """
    return (photo <= PURE[0]) & (photo.amax(-1, keepdim=True) >= PURE[1])


def residual(
    radiance: torch.Tensor, photo: torch.Tensor, encoding: Encoding, *, clipped: bool, pure: torch.Tensor | None = None
) -> torch.Tensor:
    """Encoded rendering minus encoded photo, [..., 3].

    With `clipped`, no error where it outshines a clipped channel, or one of those that are `pure` [..., 3] bool.
    """
    error = encode(radiance, encoding) - encode(photo, encoding)
    if not clipped:
        return error
    bound = photo >= CLIPPED if pure is None else (photo >= CLIPPED) | pure
    return torch.where(bound, error.clamp_max(0), error)


def l1_l2(error: torch.Tensor) -> torch.Tensor:
    """L_re = L_1 + L_2 (paper, Progressive Differentiable Rendering)."""
    return error.abs().mean() + error.square().mean()


def consistency(materials, prior, weights=(1.0, 1.0, 1.0)) -> torch.Tensor:
    """L_cons: weighted sum over albedo, roughness, metallic of the mean L1 distance to the prior.

    A weight is a number, or [P] one for each pixel.
    """
    columns = lambda x: x.reshape(len(x), -1).mean(1)  # noqa: E731  [P], also of albedo [P, 3]
    return sum((w * columns((x - p).abs())).mean() for x, p, w in zip(materials, prior, weights, strict=True))


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
