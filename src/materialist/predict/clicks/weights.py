"""Weights of ClickNet: one .safetensors file, float16, that says what it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from materialist.predict import own_weights
from materialist.predict.clicks.network import ClickNet
from materialist.predict.unet import Architecture

FORMAT = "materialist-clicks-1"
"""What the file's metadata calls itself; another number is another network."""


def save(path: Path, network: ClickNet, facts: dict[str, Any]) -> None:
    """Write the network with `facts` (recipe, steps, scores); see `own_weights.save`."""
    own_weights.save(path, network, FORMAT, facts)


def load(path: Path) -> tuple[ClickNet, dict[str, Any]]:
    """The network in evaluation mode and its facts. Raises WeightsError as `own_weights.load`."""
    build = lambda values: ClickNet(Architecture.from_dict(values))  # noqa: E731
    return own_weights.load(path, FORMAT, build, "materialist train clicks")
