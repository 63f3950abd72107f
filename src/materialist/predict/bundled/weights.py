"""Weights of the bundled network: one .safetensors file, float16, that says what it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from materialist.errors import WeightsError
from materialist.predict.bundled.network import Architecture, BundledNetwork
from materialist.predict.weights import load_weights, read_state

FORMAT = "materialist-bundled-1"
"""What the file's metadata calls itself; another number is another network."""


def save(path: Path, network: BundledNetwork, facts: dict[str, Any]) -> None:
    """Write the network as float16 with its architecture and `facts` (steps, data, scores), whole or not at all."""
    from safetensors.torch import save_file

    tensors = {k: v.detach().cpu().to(torch.float16).contiguous() for k, v in network.state_dict().items()}
    architecture = json.dumps(network.architecture.as_dict())
    partial = path.with_name(path.name + ".part")
    save_file(tensors, str(partial), {"format": FORMAT, "architecture": architecture, "facts": json.dumps(facts)})
    partial.replace(path)


def load(path: Path) -> tuple[BundledNetwork, dict[str, Any]]:
    """The network in evaluation mode, float32, and the facts it was written with.

    Raises WeightsError when the file is missing, damaged, of another format, or does not fit its architecture.
    """
    tensors = read_state(path)
    metadata = _metadata(path)
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"{path} has format {metadata.get('format')!r}, not {FORMAT!r}; write it with: materialist train export."
        )
    try:
        network = BundledNetwork(Architecture.from_dict(json.loads(metadata["architecture"])))
        facts = json.loads(metadata.get("facts", "{}"))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError) as error:
        raise WeightsError(f"{path} describes no usable network ({error}); export it again.") from error
    load_weights(network, tensors, path)
    return network.eval().requires_grad_(False).to(memory_format=torch.channels_last), facts  # type: ignore[call-overload]


def _metadata(path: Path) -> dict[str, str]:
    """The texts in the file's header; none for files of another kind."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(str(path), framework="pt") as file:
            return file.metadata() or {}
    except (SafetensorError, OSError, ValueError):
        return {}
