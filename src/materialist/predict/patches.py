"""DINOv2 ViT-S/14: features of patches of a photo, learnt from photographs alone (the family of the paper's encoder).

Oquab et al., "DINOv2: Learning Robust Visual Features without Supervision", 2023. The layers never learn here; the last
two of the twelve blocks are left out, since their features tell least of shape and cost as much as the others.
"""

from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.efficientnet import unit_power
from materialist.predict.matnet.network import PATCH, Encoder
from materialist.predict.weights import load_weights, read_state

NAME = "dinov2-vits14"
"""Name in the architectures stored with weights."""
WEIGHTS = Path(__file__).with_name("dinov2_vits14.safetensors")
WIDTH = 384
BLOCKS = 10
HEADS = 6
LAYERS = (4, 9)
"""Blocks whose features are read."""
CHANNELS = WIDTH * len(LAYERS)
STRIDE = 12
"""Pixels of the photo on a side of a patch: photos are enlarged to PATCH pixels for each."""
MEAN = (0.485, 0.456, 0.406)
DEVIATION = (0.229, 0.224, 0.225)
"""Of sRGB-encoded values in [0, 1], as the encoder was trained."""


class PatchFeatures(nn.Module):
    """sRGB picture in, features of its patches out."""

    mean: Tensor
    deviation: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.vit = Encoder(WIDTH, BLOCKS, HEADS)
        self.register_buffer("mean", torch.tensor(MEAN).view(1, 3, 1, 1), persistent=False)
        self.register_buffer(
            "deviation", torch.tensor(DEVIATION).view(1, 3, 1, 1), persistent=False
        )

    def forward(self, picture: Tensor) -> Tensor:
        """[B, CHANNELS, H / STRIDE, W / STRIDE] of sRGB pictures [B, 3, H, W] in [0, 1]; mean square 1 in each."""
        size = [max(1, round(side / STRIDE)) * PATCH for side in picture.shape[-2:]]
        enlarged = F.interpolate(picture, size, mode="bicubic", antialias=True).clamp(0, 1)
        features = self.vit((enlarged - self.mean) / self.deviation, LAYERS)
        return torch.cat([unit_power(layer) for layer in features], 1)


def shipped_patches(name: str) -> PatchFeatures:
    """The encoder in the package, in evaluation mode, not learning.

    Raises ValueError for another name than `NAME`, WeightsError when the file is missing.
    """
    if name != NAME:
        raise ValueError(f"there is no encoder '{name}', only '{NAME}'")
    encoder = PatchFeatures()
    load_weights(encoder.vit, read_state(WEIGHTS), WEIGHTS)
    return encoder.eval().requires_grad_(False)
