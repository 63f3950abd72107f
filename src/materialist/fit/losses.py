"""Losses of the fit; torch tensors, any shape that broadcasts."""

import torch

from materialist.fit.settings import Encoding, Loss, MaterialSettings


def encode(radiance: torch.Tensor, encoding: Encoding) -> torch.Tensor:
    """Radiance as the loss sees it: `linear`, `srgb` (display-encoded; both presets) or `log1p` (paper, HDR photos)."""
    if encoding == "linear":
        return radiance
    x = radiance.clamp_min(0)
    if encoding == "log1p":
        return torch.log1p(x)
    return torch.where(
        x <= 0.0031308, 12.92 * x, 1.055 * x.clamp_min(0.0031308) ** (1 / 2.4) - 0.055
    )


def decode(encoded: torch.Tensor, encoding: Encoding) -> torch.Tensor:
    """The inverse of `encode` on [0, 1]."""
    if encoding == "linear":
        return encoded
    if encoding == "log1p":
        return torch.expm1(encoded)
    return torch.where(
        encoded <= 0.04045,
        encoded / 12.92,
        ((encoded.clamp_min(0.04045) + 0.055) / 1.055) ** 2.4,
    )


def encoded_error(
    radiance: torch.Tensor,
    photo: torch.Tensor,
    encoding: Encoding,
    *,
    white: float,
    encoded: torch.Tensor | None = None,
) -> torch.Tensor:
    """Encoded rendering minus encoded photo, [..., 3]; no error where it is brighter than a channel of `white`.

    encoded: the photo encoded, where it is at hand.
    """
    seen = encode(photo, encoding) if encoded is None else encoded
    error = encode(radiance, encoding) - seen
    return torch.where(photo >= white, error.clamp_max(0), error)


def rendering_loss(error: torch.Tensor, loss: Loss = "l1+l2") -> torch.Tensor:
    """Mean loss of encoded errors: `l1+l2` is L_re = L_1 + L_2 (paper, Progressive Differentiable Rendering).

    `balanced` weighs L_2 so that it has three times the value of L_1 (published code); the weight has no gradient.
    """
    square = error.square().mean()
    if loss == "l2":
        return square
    absolute = error.abs().mean()
    if loss == "balanced":
        weight = 3 * absolute / square.clamp_min(1e-12)
        return absolute + weight.detach() * square
    return absolute + square


def consistency(
    maps: torch.Tensor,
    prior: torch.Tensor,
    settings: MaterialSettings,
    *,
    encoded: torch.Tensor | None = None,
) -> torch.Tensor:
    """delta L_cons: mean over pixels of the weighted distance of maps [P, 5] to the prior [P, 5].

    It is L1 (paper), or with an `l2` loss the square of the encoded albedo's, roughness's and metallic's change.
    encoded: [P, 3] the prior's albedo encoded, where it is at hand.
    """
    albedo, roughness, metallic = settings.weights
    # The three channels of the albedo share its weight.
    weights = torch.tensor([albedo / 3] * 3 + [roughness, metallic]).to(maps)
    if settings.loss == "l2":
        before = encode(prior[:, :3], settings.encoding) if encoded is None else encoded
        albedo_change = encode(maps[:, :3], settings.encoding) - before
        change = torch.cat([albedo_change, maps[:, 3:] - prior[:, 3:]], 1).square()
    else:
        change = (maps - prior).abs()
    return settings.delta * (change * weights).sum(1).mean()


def log_total_variation(log_map: torch.Tensor) -> torch.Tensor:
    """Mean absolute difference of neighbouring texels of a log-radiance map [h, w, 3], wrapped in azimuth."""
    return (log_map[1:] - log_map[:-1]).abs().mean() + (log_map - log_map.roll(1, 1)).abs().mean()


def log_chroma(log_map: torch.Tensor, share: torch.Tensor) -> torch.Tensor:
    """Mean colourfulness of log radiance [..., 3]: most lights are white. share: [...] what each counts, mean 1."""
    # 1e-8 gives the root a gradient at grey.
    return (
        share * ((log_map - log_map.mean(-1, keepdim=True)).square().sum(-1) + 1e-8).sqrt()
    ).mean()
