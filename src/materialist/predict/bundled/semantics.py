"""Depth and normals from what a classifier sees in a photo, and from nothing else.

A network that sees pixels and such features learns from procedural pictures to trust pixels, which differ from those of
photographs. Features of things differ less, so that what is learnt from them alone carries over better. Nor is it told
where in the picture it looks: it would learn where floors and walls mostly are.
"""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.bundled.blocks import Attention, Block

WIDTHS = (64, 96, 128, 192)
"""Channels at 1/4, 1/8, 1/16 and 1/32."""
ATTENTION = 2
"""Attention blocks at 1/32."""
DROPPED = 0.1
"""Part of the features that is hidden while it learns."""


class SemanticGeometry(nn.Module):
    """Features at four scales in, depth and normals out."""

    def __init__(self, channels: Sequence[int]):
        super().__init__()
        w = WIDTHS
        self.drop = nn.Dropout2d(DROPPED)
        self.inputs = nn.ModuleList(nn.Conv2d(c, w[k], 1) for k, c in enumerate(channels))
        self.attention = nn.ModuleList(Attention(w[3]) for _ in range(ATTENTION))
        self.blocks = nn.ModuleList(nn.Sequential(Block(w[k]), Block(w[k])) for k in range(4))
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(3))
        self.head = nn.Conv2d(w[0], 4, 1)

    def forward(self, features: Sequence[Tensor]) -> dict[str, Tensor]:
        """Maps of a picture of H x W pixels.

        Args:
            features: [B, channels[k], H / 2^(k+2), W / 2^(k+2)].

        Returns:
            semantic_depth [B, 1, H, W], natural logarithm of planar depth up to a constant; semantic_normal
            [B, 3, H, W] unit.
        """
        x: Tensor | None = None
        for k in (3, 2, 1, 0):
            y = self.inputs[k](self.drop(features[k]))
            if x is None:
                tokens = y.flatten(2).transpose(1, 2)
                for block in self.attention:
                    tokens = block(tokens)
                y = tokens.transpose(1, 2).reshape(y.shape)
            else:
                y = y + F.interpolate(self.ups[k](x), scale_factor=2, mode="nearest")
            x = self.blocks[k](y)
        assert x is not None
        raw = F.interpolate(self.head(F.silu(x)).float(), scale_factor=4, mode="bilinear", align_corners=False)
        return {"semantic_depth": raw[:, :1], "semantic_normal": facing(raw[:, 1:])}


def facing(raw: Tensor) -> Tensor:
    """Unit vectors of raw [B, 3, H, W]; raw zero looks at the viewer."""
    return F.normalize(raw + raw.new_tensor([0.0, 0.0, 1.0]).view(1, 3, 1, 1), dim=1, eps=1e-4)
