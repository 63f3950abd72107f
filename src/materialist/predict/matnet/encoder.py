"""The DINOv2 vision transformer (Oquab et al. 2023), with the parameter names of its published checkpoints."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional as F

PATCH = 14
"""Side of a patch, pixels; a picture's sides must be multiples of it."""
GRID = 37
"""The position embedding was learned on 518 x 518 pixels: 37 x 37 patches."""
OFFSET = 0.1
"""Added to the patch counts when the embedding is resized, as in DINOv2 without registers (else results differ)."""


class Encoder(nn.Module):
    """Pictures to patch tokens of several depths. `grid`: side of the learned position embedding, patches."""

    def __init__(self, width: int, blocks: int, heads: int, grid: int = GRID):
        super().__init__()
        self.cls_token = nn.Parameter(torch.zeros(1, 1, width))
        self.pos_embed = nn.Parameter(torch.zeros(1, 1 + grid * grid, width))
        # Only masked pre-training uses it; checkpoints carry it.
        self.mask_token = nn.Parameter(torch.zeros(1, width))
        self.patch_embed = nn.ModuleDict({"proj": nn.Conv2d(3, width, PATCH, stride=PATCH)})
        self.blocks = nn.ModuleList(_Block(width, heads) for _ in range(blocks))
        self.norm = nn.LayerNorm(width, eps=1e-6)
        nn.init.trunc_normal_(self.pos_embed, std=0.02)
        nn.init.normal_(self.cls_token, std=1e-6)

    def forward(self, image: Tensor, layers: Sequence[int]) -> list[Tensor]:
        """The patch features after each block in `layers` (ascending), normalised, as pictures [B, width, H / 14, W /
        14] of an image [B, 3, H, W], whose sides are multiples of 14.
        """
        rows, columns = image.shape[-2] // PATCH, image.shape[-1] // PATCH
        patches = self.patch_embed["proj"](image).flatten(2).transpose(1, 2)  # [B, rows * columns, width]
        tokens = torch.cat([self.cls_token.expand(len(patches), -1, -1), patches], 1)
        tokens = tokens + self._positions(rows, columns)
        found = []
        for k, block in enumerate(self.blocks[: max(layers) + 1]):
            tokens = block(tokens)
            if k in layers:
                features = self.norm(tokens)[:, 1:]
                found.append(features.transpose(1, 2).unflatten(-1, (rows, columns)))
        return found

    def _positions(self, rows: int, columns: int) -> Tensor:
        """[1, 1 + rows * columns, width]: the position embedding of a picture of that many patches."""
        grid = round((self.pos_embed.shape[1] - 1) ** 0.5)
        if (rows, columns) == (grid, grid):
            return self.pos_embed
        learned = self.pos_embed[:, 1:].unflatten(1, (grid, grid)).permute(0, 3, 1, 2)
        scale = ((rows + OFFSET) / grid, (columns + OFFSET) / grid)
        resized = F.interpolate(learned, scale_factor=scale, mode="bicubic")
        return torch.cat([self.pos_embed[:, :1], resized.flatten(2).transpose(1, 2)], 1)


class _Block(nn.Module):
    """Attention and a two-layer perceptron, each normalised before and scaled after (LayerScale)."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.norm1 = nn.LayerNorm(width, eps=1e-6)
        self.attn = _Attention(width, heads)
        self.ls1 = nn.ParameterDict({"gamma": torch.ones(width)})
        self.norm2 = nn.LayerNorm(width, eps=1e-6)
        layers = {"fc1": nn.Linear(width, 4 * width), "gelu": nn.GELU(), "fc2": nn.Linear(4 * width, width)}
        self.mlp = nn.Sequential(OrderedDict(layers))
        self.ls2 = nn.ParameterDict({"gamma": torch.ones(width)})

    def forward(self, tokens: Tensor) -> Tensor:
        tokens = tokens + self.ls1["gamma"] * self.attn(self.norm1(tokens))
        return tokens + self.ls2["gamma"] * self.mlp(self.norm2(tokens))


class _Attention(nn.Module):
    """Multi-head self-attention [B, N, width] -> [B, N, width], without storing the N x N matrix."""

    def __init__(self, width: int, heads: int):
        super().__init__()
        self.heads = heads
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)

    def forward(self, tokens: Tensor) -> Tensor:
        qkv = self.qkv(tokens).unflatten(-1, (3, self.heads, -1))  # [B, N, 3, heads, width / heads]
        query, key, value = qkv.permute(2, 0, 3, 1, 4)
        mixed = F.scaled_dot_product_attention(query, key, value)
        return self.proj(mixed.transpose(1, 2).flatten(2))
