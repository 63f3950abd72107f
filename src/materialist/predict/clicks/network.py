"""ClickNet: a small U-Net from the photo, its maps and clicks or a box to the object that is meant.

Clicks are encoded as Xu et al. 2016 do it, by maps of the distance to them, and by how every pixel differs from them:
in colour, in geometry, and in the features of an image classifier, which know parts of one thing by their kind.
"""

import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.predict.clicks.features import BOX, CHANNELS, SPOT
from materialist.predict.efficientnet import shipped, unit_power, zero_convolutions
from materialist.predict.network import UNet, UNetArchitecture

DEFAULT = UNetArchitecture((24, 48, 80, 112, 144), (1, 1, 2, 2, 2), "lite2")


class ClickNet(UNet):
    """Features in, one logit a pixel out."""

    FORMAT = "materialist-clicks-2"
    COMMAND = "materialist train clicks"

    def __init__(self, architecture: UNetArchitecture | None = None):
        a = architecture or DEFAULT
        super().__init__(CHANNELS, 1, a)
        if a.encoder:
            self.encoder = shipped(a.encoder)
            # A key of the stored weights, as in `BundledNetwork`.
            self.told = zero_convolutions([2 * c + 1 for c in self.encoder.channels], a.widths[1:])

    def forward(self, maps: Tensor) -> Tensor:
        """[B, S, S] float32 logits of belonging to the object, of maps [B, CHANNELS, S, S]; S a multiple of 32."""
        if not self.architecture.encoder:
            return self.raw(maps)[:, 0]
        with torch.no_grad():
            features = self.encoder((maps[:, :3] + 0.5).clamp(0, 1))
            meant = maps[:, SPOT : SPOT + 1] + maps[:, BOX : BOX + 1]
            levels = [related(unit_power(level), meant) for level in features]
        added = [convolution(level) for convolution, level in zip(self.told, levels, strict=True)]
        return self.raw(maps, added)[:, 0]


def related(features: Tensor, meant: Tensor) -> Tensor:
    """[B, 2 C + 1, h, w]: features [B, C, h, w], how they differ from those that are meant, and the cosine to those.

    meant: [B, 1, S, S] weights of the pixels whose mean they are: high at the clicks, or in the box.
    """
    weight = F.adaptive_avg_pool2d(meant, (features.shape[-2], features.shape[-1])).to(
        features.dtype
    )
    here = (features * weight).sum((2, 3), keepdim=True) / weight.sum((2, 3), keepdim=True).clamp(
        min=1e-6
    )
    cosine = F.cosine_similarity(features.float(), here.float(), dim=1)[:, None]
    return torch.cat([features, (features - here).abs(), cosine.to(features.dtype)], 1)
