"""Networks that this project trains: an architecture stored with the weights, one file format, a small U-Net."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Self

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.errors import WeightsError
from materialist.predict.weights import load_weights, metadata, read_state, write_weights

STRIDE = 32
"""Sides of the input of a network are multiples of this."""
SHARED = ("encoder.", "encoder_patches.")
"""Prefixes of the tensors of the shared image encoders (`predict.efficientnet`, `predict.patches`), which a network's
file does not hold."""


@dataclass(frozen=True)
class Architecture:
    """Widths and depths of a network."""

    def as_dict(self) -> dict[str, Any]:
        """As JSON gives them back."""
        return {k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()}


class StoredNetwork(nn.Module):
    """A network with an architecture, kept in one .safetensors file (float16) that names its kind."""

    FORMAT: ClassVar[str]
    """`format` in the file's header; another number is another network."""
    COMMAND: ClassVar[str]
    """The command that makes such a file."""
    ARCHITECTURE: ClassVar[type[Architecture]]

    def __init__(self, architecture: Any):
        super().__init__()
        self.architecture = architecture

    def save(self, path: Path, facts: dict[str, Any]) -> None:
        """Write the network with `facts` (steps, data, scores), whole or not at all; without the shared encoder."""
        tensors = {k: v for k, v in self.state_dict().items() if not k.startswith(SHARED)}
        architecture = json.dumps(self.architecture.as_dict())
        write_weights(
            path,
            tensors,
            {"format": self.FORMAT, "architecture": architecture, "facts": json.dumps(facts)},
        )

    @classmethod
    def load(cls, path: Path) -> tuple[Self, dict[str, Any]]:
        """The network in evaluation mode, float32, and the facts it was written with.

        Raises WeightsError where the file is missing, damaged, of another kind, or does not fit its architecture.
        """
        if not path.is_file():
            raise WeightsError(
                f"There are no weights of {cls.__name__} at {path}; make some with: {cls.COMMAND}."
            )
        # --- Is it a file of this network, and of which layers ---
        tensors = read_state(path)
        header = metadata(path)
        if header.get("format") != cls.FORMAT:
            raise WeightsError(
                f"{path} has format {header.get('format')!r}, not {cls.FORMAT!r}; make it with: {cls.COMMAND}."
            )
        try:
            stored = json.loads(header["architecture"]).items()
            network = cls(
                cls.ARCHITECTURE(**{k: tuple(v) if isinstance(v, list) else v for k, v in stored})
            )
            facts = json.loads(header.get("facts", "{}"))
        except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError) as error:
            raise WeightsError(
                f"{path} describes no usable network ({error}); make it with: {cls.COMMAND}."
            ) from error
        load_weights(network, tensors | shared_tensors(network), path)
        return network.eval().requires_grad_(False), facts


@lru_cache(maxsize=4)
def loaded(kind: type[StoredNetwork], path: Path) -> Any:
    """The network of a kind in a file, read once. Raises WeightsError as `StoredNetwork.load`."""
    return kind.load(path)[0]


def shared_tensors(network: nn.Module) -> dict[str, Tensor]:
    """Tensors of the network that its file does not hold."""
    return {k: v for k, v in network.state_dict().items() if k.startswith(SHARED)}


def group_norm(channels: int) -> nn.GroupNorm:
    """Statistics over each picture alone, so that small batches train and a batch of one predicts alike."""
    return nn.GroupNorm(8, channels)


class ResidualBlock(nn.Module):
    """Two normalised 3x3 convolutions added to the input; it starts as the identity (He et al. 2016)."""

    def __init__(self, channels: int):
        super().__init__()
        self.norm1 = group_norm(channels)
        self.norm2 = group_norm(channels)
        self.conv1, self.conv2 = (
            nn.Conv2d(channels, channels, 3, padding=1, bias=False) for _ in range(2)
        )
        nn.init.zeros_(self.conv2.weight)

    def forward(self, x: Tensor) -> Tensor:
        """[B, C, H, W] -> [B, C, H, W]."""
        y = self.conv1(F.silu(self.norm1(x)))
        return torch.add(x, self.conv2(F.silu(self.norm2(y))))


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
    """A U-Net at half resolution, for the networks that look at one object.

    `raw` maps [B, inputs, S, S] to [B, outputs, S, S]; it begins with 0 everywhere.
    """

    ARCHITECTURE = UNetArchitecture

    def __init__(self, inputs: int, outputs: int, architecture: UNetArchitecture):
        super().__init__(architecture)
        a = architecture
        w = architecture.widths
        self.stem = nn.Conv2d(4 * inputs, w[0], 3, padding=1)
        blocks = [
            [ResidualBlock(channels) for _ in range(n)]
            for channels, n in zip(w, a.blocks, strict=True)
        ]
        self.levels = nn.ModuleList(nn.Sequential(*level) for level in blocks)
        self.downs = nn.ModuleList(
            nn.Conv2d(w[k], w[k + 1], 3, stride=2, padding=1) for k in range(len(w) - 1)
        )
        self.ups = nn.ModuleList(nn.Conv2d(w[k + 1], w[k], 1) for k in range(len(w) - 1))
        self.decoders = nn.ModuleList(ResidualBlock(w[k]) for k in range(len(w) - 1))
        # Zero at first, so that training starts from the prior that the network corrects.
        self.head = nn.Conv2d(w[0], 4 * outputs, 3, padding=1)
        nn.init.zeros_(self.head.weight)
        assert self.head.bias is not None
        nn.init.zeros_(self.head.bias)

    def raw(self, maps: Tensor, added: Sequence[Tensor | float] = (0.0,) * 4) -> Tensor:
        """[B, outputs, S, S] float32 of maps [B, inputs, S, S]; S a multiple of STRIDE.

        `added` is added to the levels from 1/4 on: [B, widths[k], S/4, S/4] and so forth.
        """
        x = self.levels[0](self.stem(F.pixel_unshuffle(maps, 2)))
        skips = []
        for down, level, term in zip(self.downs, self.levels[1:], added, strict=True):
            skips.append(x)
            x = level(down(x) + term)
        for up, decoder, skip in zip(
            reversed(self.ups), reversed(self.decoders), reversed(skips), strict=True
        ):
            x = decoder(F.interpolate(up(x), scale_factor=2, mode="nearest") + skip)
        return F.pixel_shuffle(self.head(F.silu(x)), 2).float()
