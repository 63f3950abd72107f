"""The small U-Net of the networks that look at one object: at half resolution, with residual blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

import torch
from torch import Tensor, nn
from torch.nn import functional as F

STRIDE = 32
"""Sides of the input are multiples of this."""


@dataclass(frozen=True)
class Architecture:
    """Widths; stored with the weights."""

    widths: tuple[int, ...] = (32, 64, 96, 128, 160)
    """Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the resolution."""
    blocks: tuple[int, ...] = (1, 1, 2, 2, 2)
    """Residual blocks of the encoder at each."""
    encoder: str = ""
    """Variant of EfficientNet-Lite (`predict.lite`) whose features are read as well; "" for none."""

    def as_dict(self) -> dict[str, Any]:
        """Plain lists and texts, for JSON."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The inverse of `as_dict`; raises TypeError for unknown names."""
        plain: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in values.items()}
        return cls(**plain)


class UNet(nn.Module):
    """`raw` maps [B, inputs, S, S] to [B, outputs, S, S]; it begins with 0 everywhere."""

    def __init__(self, inputs: int, outputs: int, architecture: Architecture):
        super().__init__()
        self.architecture = a = architecture
        w = a.widths
        self.stem = nn.Conv2d(4 * inputs, w[0], 3, padding=1)
        self.levels = nn.ModuleList(nn.Sequential(*(_Block(w[k]) for _ in range(a.blocks[k]))) for k in range(len(w)))
        self.downs = nn.ModuleList(nn.Conv2d(w[k], w[k + 1], 3, stride=2, padding=1) for k in range(len(w) - 1))
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(len(w) - 1))
        self.decoders = nn.ModuleList(_Block(w[k]) for k in range(len(w) - 1))
        self.head = nn.Conv2d(w[0], 4 * outputs, 3, padding=1)
        nn.init.zeros_(self.head.weight)
        assert self.head.bias is not None
        nn.init.zeros_(self.head.bias)

    def raw(self, maps: Tensor, told: Sequence[Tensor | float] = (0.0,) * 4) -> Tensor:
        """[B, outputs, S, S] float32 of maps [B, inputs, S, S]; S a multiple of STRIDE. `told`: what is added to the
        levels from 1/4 on, [B, widths[k], S/4, S/4] and so forth."""
        x = self.levels[0](self.stem(F.pixel_unshuffle(maps, 2)))
        skips = []
        for down, level, more in zip(self.downs, self.levels[1:], told, strict=True):
            skips.append(x)
            x = level(down(x) + more)
        for up, decoder, skip in zip(reversed(self.ups), reversed(self.decoders), reversed(skips), strict=True):
            x = decoder(F.interpolate(up(x), scale_factor=2, mode="nearest") + skip)
        return F.pixel_shuffle(self.head(F.silu(x)), 2).float()


class _Block(nn.Module):
    """Residual block: two normalised 3x3 convolutions, starting as the identity."""

    def __init__(self, channels: int):
        super().__init__()
        self.norm1, self.norm2 = (nn.GroupNorm(8, channels) for _ in range(2))
        self.conv1, self.conv2 = (nn.Conv2d(channels, channels, 3, padding=1, bias=False) for _ in range(2))
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor) -> Tensor:
        y = self.conv1(F.silu(self.norm1(x)))
        return torch.add(x, self.conv2(F.silu(self.norm2(y))))
