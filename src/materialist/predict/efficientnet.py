"""EfficientNet-Lite2: convolutions of an image classifier, as features that tell objects from their surroundings.

Tan and Le, "EfficientNet", 2019, without squeeze and excitation (Liu, "Higher accuracy on vision models with
EfficientNet-Lite", 2020). Batch normalisation is folded into the convolutions, because these layers never learn here.
Google trained them on the photographs of ImageNet (Apache 2.0; docs/training.md).
"""

import math
from collections.abc import Iterable
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.predict.weights import load_weights, read_state

NAME = "lite2"
"""Name of the variant in the architectures stored with weights."""
WEIGHTS = Path(__file__).with_name("lite2.safetensors")
STAGES = (
    # repeats, kernel, stride, expansion, inputs, outputs: EfficientNet's table 1 at 1.1 times the width, 1.2 the depth
    (1, 3, 1, 1, 32, 16),
    (3, 3, 2, 6, 16, 24),
    (3, 5, 2, 6, 24, 48),
    (4, 3, 2, 6, 48, 88),
    (4, 5, 1, 6, 88, 120),
    (5, 5, 2, 6, 120, 208),
    (1, 3, 1, 6, 208, 352),
)
OUTPUTS = (1, 2, 4, 6)
"""Stages whose results are the features: those at 1/4, 1/8, 1/16 and 1/32 of the resolution."""
MEAN = 127 / 255
SCALE = 128 / 255
"""Of sRGB-encoded values in [0, 1], as the classifier was trained."""


class EfficientNetLite(nn.Module):
    """sRGB picture in, features at four scales out."""

    def __init__(self) -> None:
        super().__init__()
        self.stem = nn.Conv2d(3, 32, 3, 2)
        blocks = []
        self.last_blocks = []
        """Number of the block after which each of OUTPUTS is complete."""
        for number, (repeats, kernel, stride, expansion, inputs, outputs) in enumerate(STAGES):
            for k in range(repeats):
                # Only the first block of a stage changes resolution and channels.
                first = k == 0
                blocks.append(
                    _MBConv(
                        inputs if first else outputs,
                        outputs,
                        kernel,
                        stride if first else 1,
                        expansion,
                    )
                )
            if number in OUTPUTS:
                self.last_blocks.append(len(blocks) - 1)
        self.blocks = nn.ModuleList(blocks)
        self.channels = tuple(STAGES[number][-1] for number in OUTPUTS)
        """Channels of the four features."""

    def forward(self, picture: Tensor) -> list[Tensor]:
        """Features [B, channels[k], H / 2^(k+2), W / 2^(k+2)] of sRGB pictures [B, 3, H, W] in [0, 1]."""
        # The classifier's own normalisation: weights that never learn need the input that they
        # learned on.
        x = F.relu6(_same_padding(self.stem, (picture - MEAN) / SCALE))
        features = []
        for k, block in enumerate(self.blocks):
            x = block(x)
            if k in self.last_blocks:
                features.append(x)
        return features


class _MBConv(nn.Module):
    """Inverted residual block (Sandler et al. 2018): widen, convolve each channel, narrow."""

    def __init__(self, inputs: int, outputs: int, kernel: int, stride: int, expansion: int):
        super().__init__()
        wide = inputs * expansion
        self.expand = nn.Conv2d(inputs, wide, 1) if expansion > 1 else None
        self.depthwise = nn.Conv2d(wide, wide, kernel, stride, groups=wide)
        self.project = nn.Conv2d(wide, outputs, 1)
        self.residual = stride == 1 and inputs == outputs

    def forward(self, x: Tensor) -> Tensor:
        y = x if self.expand is None else F.relu6(self.expand(x))
        y = self.project(F.relu6(_same_padding(self.depthwise, y)))
        return x + y if self.residual else y


def _same_padding(conv: nn.Conv2d, x: Tensor) -> Tensor:
    """The convolution with TensorFlow's "same" padding: an odd pixel goes to the right and the bottom."""
    kernel = conv.kernel_size[0]
    stride = conv.stride[0]
    sides = []
    for length in (x.shape[-1], x.shape[-2]):
        # Total padding after which the output has ceil(length / stride) pixels.
        missing = max((math.ceil(length / stride) - 1) * stride + kernel - length, 0)
        sides += [missing // 2, missing - missing // 2]
    return conv(F.pad(x, sides))


def shipped(name: str) -> EfficientNetLite:
    """The encoder in the package, in evaluation mode, not learning.

    Raises ValueError for another name than `NAME`, WeightsError when the file is missing.
    """
    if name != NAME:
        raise ValueError(f"there is no encoder '{name}', only '{NAME}'")
    encoder = EfficientNetLite()
    load_weights(encoder, read_state(WEIGHTS), WEIGHTS)
    return encoder.eval().requires_grad_(False).to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def zero_convolutions(channels: Iterable[int], widths: Iterable[int]) -> nn.ModuleList:
    """Convolutions 1 x 1 from features to the levels of a network, which begin by telling nothing."""
    layers = nn.ModuleList(nn.Conv2d(c, w, 1) for c, w in zip(channels, widths, strict=True))
    for parameter in layers.parameters():
        nn.init.zeros_(parameter)
    return layers


def unit_power(features: Tensor) -> Tensor:
    """Features [B, C, h, w] with a mean square of 1 in each picture."""
    return features * features.float().square().mean((1, 2, 3), keepdim=True).add(1e-6).rsqrt().to(
        features.dtype
    )
