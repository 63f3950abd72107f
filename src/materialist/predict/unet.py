"""The small U-Net of the networks that look at one object: at half resolution, with residual blocks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.network import Architecture, ResidualBlock, StoredNetwork

STRIDE = 32
"""Sides of the input are multiples of this."""


@dataclass(frozen=True)
class UNetArchitecture(Architecture):
    """Widths and depths of a UNet."""

    widths: tuple[int, ...] = (32, 64, 96, 128, 160)
    """Channels at 1/2, 1/4, 1/8, 1/16 and 1/32 of the resolution."""
    blocks: tuple[int, ...] = (1, 1, 2, 2, 2)
    """Residual blocks of the encoder at each."""
    encoder: str = ""
    """Variant of EfficientNet-Lite (`predict.efficientnet`) whose features are read as well; "" for none."""


class UNet(StoredNetwork):
    """`raw` maps [B, inputs, S, S] to [B, outputs, S, S]; it begins with 0 everywhere."""

    ARCHITECTURE = UNetArchitecture

    def __init__(self, inputs: int, outputs: int, architecture: UNetArchitecture):
        super().__init__(architecture)
        a, w = architecture, architecture.widths
        self.stem = nn.Conv2d(4 * inputs, w[0], 3, padding=1)
        blocks = [[ResidualBlock(channels) for _ in range(n)] for channels, n in zip(w, a.blocks, strict=True)]
        self.levels = nn.ModuleList(nn.Sequential(*level) for level in blocks)
        self.downs = nn.ModuleList(nn.Conv2d(w[k], w[k + 1], 3, stride=2, padding=1) for k in range(len(w) - 1))
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(len(w) - 1))
        self.decoders = nn.ModuleList(ResidualBlock(w[k]) for k in range(len(w) - 1))
        self.head = nn.Conv2d(w[0], 4 * outputs, 3, padding=1)
        nn.init.zeros_(self.head.weight)
        assert self.head.bias is not None
        nn.init.zeros_(self.head.bias)

    def raw(self, maps: Tensor, told: Sequence[Tensor | float] = (0.0,) * 4) -> Tensor:
        """[B, outputs, S, S] float32 of maps [B, inputs, S, S]; S a multiple of STRIDE.

        `told` is added to the levels from 1/4 on: [B, widths[k], S/4, S/4] and so forth.
        """
        x = self.levels[0](self.stem(F.pixel_unshuffle(maps, 2)))
        skips = []
        for down, level, more in zip(self.downs, self.levels[1:], told, strict=True):
            skips.append(x)
            x = level(down(x) + more)
        for up, decoder, skip in zip(reversed(self.ups), reversed(self.decoders), reversed(skips), strict=True):
            x = decoder(F.interpolate(up(x), scale_factor=2, mode="nearest") + skip)
        return F.pixel_shuffle(self.head(F.silu(x)), 2).float()
