"""EfficientNet-Lite: an image classifier's convolutions, as features that tell things from what is around them.

Tan and Le, "EfficientNet", 2019, in the variants without squeeze and excitation (Liu, "Higher accuracy on vision models
with EfficientNet-Lite", 2020). Batch normalisation is folded into the convolutions: these layers never learn here.
Those that the package has were trained by Google on the photographs of ImageNet (Apache 2.0; docs/training.md).
"""

from __future__ import annotations

import copy
import math
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.errors import InputError, WeightsError

STAGES = ((1, 3, 1, 1, 16), (2, 3, 2, 6, 24), (2, 5, 2, 6, 40), (3, 3, 2, 6, 80), (3, 5, 1, 6, 112), (4, 5, 2, 6, 192))
"""Repeats, kernel, stride, expansion and channels of the stages at width and depth 1 (EfficientNet, table 1)."""
LAST_STAGE = (1, 3, 1, 6, 320)
TOLD = (1, 2, 4, 6)
"""Stages whose answers are given: those at 1/4, 1/8, 1/16 and 1/32 of the resolution."""
SIZES = {"lite0": (1.0, 1.0), "lite1": (1.0, 1.1), "lite2": (1.1, 1.2)}
"""Width and depth of the variants."""
MEAN, SPREAD = 127 / 255, 128 / 255
"""Of sRGB-encoded values in [0, 1], as the classifier was trained."""
NORM_EPS = 1e-3
FORMAT = "materialist-encoder-1"


@dataclass(frozen=True)
class _Layer:
    inputs: int
    outputs: int
    kernel: int
    stride: int
    expansion: int


class LiteEncoder(nn.Module):
    """sRGB picture in, features at four scales out."""

    def __init__(self, size: str):
        """One of random weights; `size` is one of SIZES, InputError for another. See `shipped`."""
        super().__init__()
        if size not in SIZES:
            raise InputError(f"There is no encoder '{size}'; choose one of {', '.join(SIZES)}.")
        self.size = size
        self.stem = nn.Conv2d(3, 32, 3, 2)
        self.blocks = nn.ModuleList(_MBConv(layer) for layer in _layers(size))
        ends = [sum(_repeats(size)[: k + 1]) - 1 for k in TOLD]
        self.told = tuple(ends)
        self.channels = tuple(_layers(size)[k].outputs for k in ends)
        """Channels of the four answers."""

    def forward(self, picture: Tensor) -> list[Tensor]:
        """Features [B, channels[k], H / 2^(k+2), W / 2^(k+2)] of sRGB pictures [B, 3, H, W] in [0, 1]."""
        x = F.relu6(_same(self.stem, (picture - MEAN) / SPREAD))
        found = []
        for k, block in enumerate(self.blocks):
            x = block(x)
            if k in self.told:
                found.append(x)
        return found


class _MBConv(nn.Module):
    """Inverted residual block (Sandler et al. 2018): widen, convolve each channel, narrow."""

    def __init__(self, layer: _Layer):
        super().__init__()
        wide = layer.inputs * layer.expansion
        self.expand = nn.Conv2d(layer.inputs, wide, 1) if layer.expansion > 1 else None
        self.depthwise = nn.Conv2d(wide, wide, layer.kernel, layer.stride, groups=wide)
        self.project = nn.Conv2d(wide, layer.outputs, 1)
        self.residual = layer.stride == 1 and layer.inputs == layer.outputs

    def forward(self, x: Tensor) -> Tensor:
        y = x if self.expand is None else F.relu6(self.expand(x))
        y = self.project(F.relu6(_same(self.depthwise, y)))
        return x + y if self.residual else y


def _same(conv: nn.Conv2d, x: Tensor) -> Tensor:
    """The convolution with TensorFlow's padding: what is odd goes to the right and the bottom."""
    kernel, stride = conv.kernel_size[0], conv.stride[0]
    sides = []
    for length in (x.shape[-1], x.shape[-2]):
        missing = max((math.ceil(length / stride) - 1) * stride + kernel - length, 0)
        sides += [missing // 2, missing - missing // 2]
    return conv(F.pad(x, sides))


def _repeats(size: str) -> list[int]:
    """Blocks of each stage; the first and the last are not deepened."""
    deep = SIZES[size][1]
    return [STAGES[0][0], *(math.ceil(deep * stage[0]) for stage in STAGES[1:]), LAST_STAGE[0]]


def _layers(size: str) -> list[_Layer]:
    """All blocks; the stem keeps 32 channels in every variant."""
    wide = SIZES[size][0]
    layers: list[_Layer] = []
    inputs = 32
    for count, (_, kernel, stride, expansion, channels) in zip(_repeats(size), (*STAGES, LAST_STAGE), strict=True):
        outputs = _rounded(channels * wide)
        for k in range(count):
            layers.append(_Layer(inputs, outputs, kernel, stride if k == 0 else 1, expansion))
            inputs = outputs
    return layers


def _rounded(channels: float) -> int:
    """A multiple of 8, not more than a tenth below (EfficientNet's round_filters)."""
    found = max(8, int(channels + 4) // 8 * 8)
    return found + 8 if found < 0.9 * channels else found


def shipped(size: str) -> LiteEncoder:
    """The encoder in the package, in evaluation mode, not learning. Raises WeightsError when it is missing."""
    return copy.deepcopy(_read(size))


@lru_cache(maxsize=1)
def _read(size: str) -> LiteEncoder:
    from materialist.predict.weights import load_weights, read_state

    path = Path(__file__).parent / f"{size}.safetensors"
    encoder = LiteEncoder(size)
    load_weights(encoder, read_state(path), path)
    return encoder.eval().requires_grad_(False).to(memory_format=torch.channels_last)  # type: ignore[call-overload]


def convert(checkpoint: str | Path, size: str, output: str | Path) -> None:
    """Write a classifier's checkpoint (see `read_classifier`) as the float16 file that `shipped` reads.

    Raises InputError for an unknown size, WeightsError for a checkpoint that does not fit.
    """
    from safetensors.torch import save_file

    encoder = LiteEncoder(size)
    read_classifier(encoder, Path(checkpoint))
    tensors = {name: tensor.to(torch.float16).contiguous() for name, tensor in encoder.state_dict().items()}
    source = {"format": FORMAT, "source": Path(checkpoint).name, "license": "Apache-2.0"}
    save_file(tensors, str(output), source)


def level(features: Tensor) -> Tensor:
    """Features [B, C, h, w] with a mean square of 1 in each picture."""
    return features * features.float().square().mean((1, 2, 3), keepdim=True).add(1e-6).rsqrt().to(features.dtype)


def read_classifier(encoder: LiteEncoder, path: Path) -> None:
    """Fill the encoder from a classifier's checkpoint with the names of efficientnet_lite_pytorch.

    Raises WeightsError when the file is damaged, or is that of another variant.
    """
    from materialist.predict.weights import load_weights, read_state

    state = read_state(path)
    try:
        tensors = _folded(state, "_conv_stem", "_bn0", "stem")
        for k, block in enumerate(encoder.blocks):
            assert isinstance(block, _MBConv)
            names = {"depthwise": ("_depthwise_conv", "_bn1"), "project": ("_project_conv", "_bn2")}
            if block.expand is not None:
                names["expand"] = ("_expand_conv", "_bn0")
            for mine, (conv, norm) in names.items():
                tensors |= _folded(state, f"_blocks.{k}.{conv}", f"_blocks.{k}.{norm}", f"blocks.{k}.{mine}")
    except KeyError as error:
        raise WeightsError(f"{path} has no tensor {error}: it is no EfficientNet-{encoder.size} checkpoint.") from error
    load_weights(encoder, tensors, path)


def _folded(state: dict[str, Tensor], conv: str, norm: str, name: str) -> dict[str, Tensor]:
    """Weight and bias of a convolution with the batch normalisation after it."""
    gain = state[f"{norm}.weight"] / torch.sqrt(state[f"{norm}.running_var"] + NORM_EPS)
    return {
        f"{name}.weight": state[f"{conv}.weight"] * gain.view(-1, 1, 1, 1),
        f"{name}.bias": state[f"{norm}.bias"] - state[f"{norm}.running_mean"] * gain,
    }
