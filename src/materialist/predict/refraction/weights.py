"""Weights of RefractionNet: one .safetensors file, float16, that says what it is."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from materialist.errors import WeightsError
from materialist.predict.refraction.network import Architecture, RefractionNet
from materialist.predict.weights import load_weights, read_state

FORMAT = "materialist-refraction-1"
"""What the file's metadata calls itself; another number is another network."""


def save(path: Path, network: RefractionNet, facts: dict[str, Any]) -> None:
    """Write the network as float16 with its architecture and `facts` (recipe, steps, scores), whole or not at all."""
    from safetensors.torch import save_file

    tensors = {k: v.detach().cpu().to(torch.float16).contiguous() for k, v in network.state_dict().items()}
    architecture = json.dumps(network.architecture.as_dict())
    partial = path.with_name(path.name + ".part")
    save_file(tensors, str(partial), {"format": FORMAT, "architecture": architecture, "facts": json.dumps(facts)})
    partial.replace(path)


def load(path: Path) -> tuple[RefractionNet, dict[str, Any]]:
    """The network in evaluation mode, float32, and the facts it was written with.

    Raises WeightsError when the file is missing, damaged, of another format, or does not fit its architecture.
    """
    from safetensors import safe_open

    tensors = read_state(path)
    metadata: dict[str, str] = {}
    if path.suffix == ".safetensors":
        with safe_open(str(path), framework="pt") as file:
            metadata = file.metadata() or {}
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"{path} has format {metadata.get('format')!r}, not {FORMAT!r}; train it: materialist train refraction."
        )
    try:
        network = RefractionNet(Architecture.from_dict(json.loads(metadata["architecture"])))
        facts = json.loads(metadata.get("facts", "{}"))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError) as error:
        raise WeightsError(f"{path} describes no usable network ({error}); train it again.") from error
    load_weights(network, tensors, path)
    return network.eval().requires_grad_(False), facts
