"""What the bundled network is built of."""

from __future__ import annotations

from torch import Tensor, nn
from torch.nn import functional as F


def conv(inputs: int, outputs: int, *, bias: bool = False) -> nn.Conv2d:
    """A 3x3 convolution that keeps the size."""
    return nn.Conv2d(inputs, outputs, 3, padding=1, bias=bias)


def norm(channels: int) -> nn.GroupNorm:
    """Normalisation in eight groups."""
    # Statistics over each picture alone: small batches train, and a batch of one predicts, alike.
    return nn.GroupNorm(8, channels)


def shrink(rays: Tensor, factor: int) -> Tensor:
    """Mean ray of every factor x factor cell."""
    return F.avg_pool2d(rays, factor)


class Block(nn.Module):
    """Residual block: two normalised 3x3 convolutions, starting as the identity."""

    def __init__(self, channels: int):
        super().__init__()
        self.norm1, self.conv1 = norm(channels), conv(channels, channels)
        self.norm2, self.conv2 = norm(channels), conv(channels, channels)
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor) -> Tensor:
        y = self.conv1(F.silu(self.norm1(x)))
        return x + self.conv2(F.silu(self.norm2(y)))


class Attention(nn.Module):
    """Pre-norm transformer block over cells [B, n, C]; cells know their place from their rays."""

    def __init__(self, channels: int, head_size: int = 32):
        super().__init__()
        self.heads = channels // head_size
        self.norm1, self.norm2 = nn.LayerNorm(channels), nn.LayerNorm(channels)
        self.qkv, self.out = nn.Linear(channels, 3 * channels), nn.Linear(channels, channels)
        self.up, self.down = nn.Linear(channels, 3 * channels), nn.Linear(3 * channels, channels)

    def forward(self, x: Tensor) -> Tensor:
        batch, cells, channels = x.shape
        qkv = self.qkv(self.norm1(x)).view(batch, cells, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        seen = F.scaled_dot_product_attention(qkv[0], qkv[1], qkv[2])
        x = x + self.out(seen.transpose(1, 2).reshape(batch, cells, channels))
        return x + self.down(F.gelu(self.up(self.norm2(x))))
