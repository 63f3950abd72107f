"""MatNet: albedo, roughness, metallic, normal and depth from one linear picture (paper, eq. "matnet")."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.matnet.encoder import GRID, Encoder
from materialist.predict.matnet.head import Head


@dataclass(frozen=True)
class Size:
    """How large the network is."""

    width: int
    blocks: int
    heads: int
    layers: tuple[int, int, int, int]
    """The encoder blocks whose tokens the decoders read."""
    pyramid: tuple[int, int, int, int]
    fused: int
    grid: int = GRID


SIZES = {
    "vits": Size(384, 12, 6, (2, 5, 8, 11), (48, 96, 192, 384), 64),
    "vitb": Size(768, 12, 12, (2, 5, 8, 11), (96, 192, 384, 768), 128),
    "vitl": Size(1024, 24, 16, (4, 11, 17, 23), (256, 512, 1024, 1024), 256),
}
"""The published MatNet is 'vitb'; the others follow Depth Anything, whose checkpoints can start their training."""


class MatNet(nn.Module):
    """One encoder, one decoder for depth, one for materials and normals (paper, section "Material Prediction Network").

    The state dict has the names of the published checkpoint, so `load_state_dict(..., strict=True)` takes it.
    """

    def __init__(self, size: str | Size = "vitb"):
        super().__init__()
        if isinstance(size, str):
            size = SIZES[size]
        self.size = size
        self.pretrained = Encoder(size.width, size.blocks, size.heads, size.grid)
        self.depth_head = Head(size.width, size.pyramid, size.fused, outputs=1)
        self.material_head = Head(size.width, size.pyramid, size.fused, outputs=8)

    def forward(self, image: Tensor) -> dict[str, Tensor]:
        """The raw outputs, for training.

        Args:
            image: [B, 3, H, W] linear RGB, about [0, 1], without mean and deviation; H and W multiples of 14.

        Returns:
            albedo [B, 3, H, W], roughness, metallic, depth [B, 1, H, W]: >= 0, not bounded above; normal
            [B, 3, H, W]: unit, camera frame (+X right, +Y up, +Z to the viewer). What `depth` means depends on the
            weights: in the published ones it falls with distance (see `planar_depth`).
        """
        features = self.pretrained(image, self.size.layers)
        materials = self.material_head(features)
        positive = F.relu(materials[:, :5])
        return {
            "depth": F.relu(self.depth_head(features)),
            "albedo": positive[:, :3],
            "roughness": positive[:, 3:4],
            "metallic": positive[:, 4:5],
            "normal": F.normalize(torch.tanh(materials[:, 5:]), dim=1, eps=1e-6),
        }
