"""Weights of the bundled network: one .safetensors file, float16, that says what it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from materialist.predict import own_weights
from materialist.predict.bundled.network import Architecture, BundledNetwork

FORMAT = "materialist-bundled-1"
"""What the file's metadata calls itself; another number is another network."""


def save(path: Path, network: BundledNetwork, facts: dict[str, Any]) -> None:
    """Write the network with `facts` (steps, data, scores); see `own_weights.save`."""
    own_weights.save(path, network, FORMAT, facts)


def load(path: Path) -> tuple[BundledNetwork, dict[str, Any]]:
    """The network in evaluation mode and its facts. Raises WeightsError as `own_weights.load`."""
    build = lambda values: BundledNetwork(Architecture.from_dict(values))  # noqa: E731
    network, facts = own_weights.load(path, FORMAT, build, "materialist train export")
    return network.to(memory_format=torch.channels_last), facts
