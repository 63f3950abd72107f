"""The light that explains a photo best by transport alone: least squares over texels that may not be negative."""

from __future__ import annotations

import torch

from materialist.fit.light import start_radiance
from materialist.fit.losses import encode, residual, too_pure
from materialist.fit.settings import LightSettings

ROUNDS = 2
"""Reweightings towards the absolute error of encoded radiance,"""
DESCENT = 30
"""and steps of projected gradients after each."""
START = 0.5
"""Radiance at which the light of a photo that is not dark begins."""
RIDGE = 1e-3
"""Price of bright texels that hardly reach anything, relative to that of a mean texel's error."""
SMALL = 0.02
"""Encoded errors below this count by their square."""


def explained(
    transport: torch.Tensor, rest: torch.Tensor, photo: torch.Tensor, settings: LightSettings,
    start: torch.Tensor | None = None,
) -> tuple[float, torch.Tensor]:  # fmt: skip
    """How well the best light E >= 0 explains a photo by transport E + rest, and that light.

    Least squares, reweighted so that absolute differences of encoded radiance count.

    Args:
        transport: [3, Q, texels] per channel. rest: [Q, 3]. photo: [Q, 3] linear.
        start: [3, texels] a light to begin with.

    Returns:
        Mean absolute encoded error, and the light [3, texels].
    """
    pure = too_pure(photo).T
    rest, photo = rest.T, photo.T  # [3, Q]
    if start is None:
        start = torch.full(transport.shape[::2], start_radiance(photo, START))
    light = start
    for _ in range(ROUNDS):
        radiance = (transport @ light[..., None])[..., 0] + rest
        error = residual(radiance, photo, settings.encoding, clipped=settings.clipped, pure=pure)
        away = radiance - photo
        away = torch.where(away.abs() < 1e-4, 1e-4, away)
        slope = ((encode(photo + away, settings.encoding) - encode(photo, settings.encoding)) / away).abs()
        weight = slope * torch.where((error == 0) & (away > 0), 0.0, error.abs().clamp_min(SMALL).rsqrt())  # [3, Q]
        light = nonnegative(transport * weight[..., None], (photo - rest) * weight, light)
    radiance = (transport @ light[..., None])[..., 0] + rest
    error = residual(radiance, photo, settings.encoding, clipped=settings.clipped, pure=pure)
    return float(error.abs().mean()), light


def nonnegative(matrix: torch.Tensor, target: torch.Tensor, start: torch.Tensor) -> torch.Tensor:
    """[3, texels] x >= 0 of least |matrix x - target|^2 + ridge, by accelerated projected gradients from `start`."""
    gram = torch.stack([each.t() @ each for each in matrix])  # [3, texels, texels]; symmetric: its rows are its columns
    mean = gram.diagonal(dim1=1, dim2=2).mean(1)  # [3]
    gram = gram + RIDGE * mean[:, None, None] * torch.eye(gram.shape[-1])
    right = (matrix.transpose(1, 2) @ target[..., None])[..., 0]
    # A symmetric matrix without negative entries is at most the diagonal of its row sums: safe steps for each texel.
    scale = gram.sum(-1).clamp_min(1e-12).reciprocal()  # [3, texels]
    x, y, t = start, start, 1.0
    for _ in range(DESCENT):
        new = (y - scale * ((y[:, None] @ gram)[:, 0] - right)).clamp_min(0)
        if bool(((y - new) * (new - x)).sum() > 0):
            t = 1.0
        after = (1 + (1 + 4 * t * t) ** 0.5) / 2
        y, x, t = new + (t - 1) / after * (new - x), new, after
    return x
