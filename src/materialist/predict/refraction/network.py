"""RefractionNet: a small U-Net from the maps of an object to its thickness and the normals of its back.

The paper has the decoder of its depth prediction here. This one sees the photo, the geometry, and the thickness by
symmetry, and answers with a factor on the latter and a turn of the mirrored normals: it starts as the symmetry prior
and learns where that is wrong. Normals have an answer of their own because glass is decided by them, and a soft map of
thickness says little about which way the back leans.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.refraction.crop import ANSWERS, BACK_X, CHANNELS, MASK, MIRROR, NORMAL_X

STRIDE = 32
"""Sides of the input are multiples of this."""
LEAST = 0.05
"""Added to the mirrored thickness, in units of the object's size, so that a factor can change where that is 0."""


@dataclass(frozen=True)
class Architecture:
    """Widths; stored with the weights."""

    widths: tuple[int, ...] = (32, 64, 96, 128, 160)
    """Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the resolution."""
    blocks: tuple[int, ...] = (1, 1, 2, 2, 2)
    """Residual blocks of the encoder at each."""

    def as_dict(self) -> dict[str, Any]:
        """Plain lists, for JSON."""
        return {k: list(v) for k, v in asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Architecture:
        """The inverse of `as_dict`; raises TypeError for unknown names."""
        plain: dict[str, Any] = {k: tuple(v) for k, v in values.items()}
        return cls(**plain)


class RefractionNet(nn.Module):
    """Features of an object in, solid and hollow thickness and normals of the back out."""

    def __init__(self, architecture: Architecture | None = None):
        super().__init__()
        self.architecture = a = architecture or Architecture()
        w = a.widths
        self.stem = nn.Conv2d(4 * CHANNELS, w[0], 3, padding=1)
        self.levels = nn.ModuleList(nn.Sequential(*(_Block(w[k]) for _ in range(a.blocks[k]))) for k in range(len(w)))
        self.downs = nn.ModuleList(nn.Conv2d(w[k], w[k + 1], 3, stride=2, padding=1) for k in range(len(w) - 1))
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(len(w) - 1))
        self.decoders = nn.ModuleList(_Block(w[k]) for k in range(len(w) - 1))
        self.head = nn.Conv2d(w[0], 4 * ANSWERS, 3, padding=1)
        nn.init.zeros_(self.head.weight)
        assert self.head.bias is not None
        nn.init.zeros_(self.head.bias)

    def forward(self, maps: Tensor) -> Tensor:
        """Thickness and back of a batch of objects.

        Args:
            maps: [B, CHANNELS, S, S] float32 of `crop.features`; S a multiple of 32.

        Returns:
            [B, 5, S, S] float32, 0 outside the mask: solid thickness, in units of the object's size; hollow <= solid;
            the outward normal of the last surface, unit, in the frame of the features, away from the viewer.
        """
        x = self.levels[0](self.stem(F.pixel_unshuffle(maps, 2)))
        skips = []
        for down, level in zip(self.downs, self.levels[1:], strict=True):
            skips.append(x)
            x = level(down(x))
        for up, decoder, skip in zip(reversed(self.ups), reversed(self.decoders), reversed(skips), strict=True):
            x = decoder(F.interpolate(up(x), scale_factor=2, mode="nearest") + skip)
        raw = F.pixel_shuffle(self.head(F.silu(x)), 2).float()
        inside = maps[:, MASK : MASK + 1]
        solid = (maps[:, MIRROR : MIRROR + 1] + LEAST) * (3 * torch.tanh(raw[:, :1] / 3)).exp()
        normal = maps[:, NORMAL_X : NORMAL_X + 3]
        mirrored = torch.cat([normal[:, :2], -normal[:, 2:]], 1)
        return torch.cat([solid, solid * raw[:, 1:2].sigmoid(), unit(mirrored + raw[:, 2:])], 1) * inside


def both_ways(network: RefractionNet, maps: Tensor) -> Tensor:
    """The mean [B, 5, S, S] of what the network says of maps [B, CHANNELS, S, S] and of their mirror image."""
    mirrored = maps.flip(-1)
    mirrored[:, NORMAL_X] = -mirrored[:, NORMAL_X]
    other = network(mirrored).flip(-1)
    other[:, BACK_X] = -other[:, BACK_X]
    mean = (network(maps) + other) / 2
    return torch.cat([mean[:, :BACK_X], unit(mean[:, BACK_X:])], 1)


def unit(vectors: Tensor) -> Tensor:
    """Vectors [B, 3, S, S] of length 1; none stay none."""
    return vectors / vectors.square().sum(1, keepdim=True).clamp(min=1e-8).sqrt()


class _Block(nn.Module):
    """Residual block: two normalised 3x3 convolutions, starting as the identity."""

    def __init__(self, channels: int):
        super().__init__()
        self.norm1, self.norm2 = (nn.GroupNorm(8, channels) for _ in range(2))
        self.conv1, self.conv2 = (nn.Conv2d(channels, channels, 3, padding=1, bias=False) for _ in range(2))
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor) -> Tensor:
        y = self.conv1(F.silu(self.norm1(x)))
        return x + self.conv2(F.silu(self.norm2(y)))
