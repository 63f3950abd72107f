"""ClickNet: a small U-Net from the photo, its maps and a click to the object that was clicked on.

Clicks are told as Xu et al. 2016 do it, by maps of the distance to them, and by how every pixel differs from them.
"""

from __future__ import annotations

from torch import Tensor

from materialist.predict.clicks.features import CHANNELS
from materialist.predict.unet import Architecture, UNet

WIDTHS = Architecture((24, 48, 80, 112, 144), (1, 1, 2, 2, 2))


class ClickNet(UNet):
    """Features in, one logit a pixel out."""

    def __init__(self, architecture: Architecture | None = None):
        super().__init__(CHANNELS, 1, architecture or WIDTHS)

    def forward(self, maps: Tensor) -> Tensor:
        """[B, S, S] float32 logits of belonging to the object, of maps [B, CHANNELS, S, S]; S a multiple of 32."""
        return self.raw(maps)[:, 0]
