"""Weights that this project trains: one .safetensors file, float16, that says what it is and how it is built."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import WeightsError
from materialist.predict.weights import load_weights, read_state

PREFIX = "encoder."
"""Where a network keeps the encoder that it shares with others (`predict.lite`): not stored with its weights."""


def save(path: Path, network: Any, kind: str, facts: dict[str, Any]) -> None:
    """Write a network that has an `architecture`, as float16, with `facts` (steps, data, scores), whole or not at all.

    The encoder that networks share (`predict.lite`) is not written: it is in the package.

    kind: what the file calls itself; another number is another network.
    """
    own = {k: v for k, v in network.state_dict().items() if not k.startswith(PREFIX)}
    architecture = json.dumps(network.architecture.as_dict())
    write(path, own, {"format": kind, "architecture": architecture, "facts": json.dumps(facts)})


def write(path: Path, tensors: dict[str, Any], texts: dict[str, str]) -> None:
    """Write tensors as float16, with `texts` in the header, whole or not at all."""
    import torch
    from safetensors.torch import save_file

    half = {name: tensor.detach().cpu().to(torch.float16).contiguous() for name, tensor in tensors.items()}
    partial = path.with_name(path.name + ".part")
    save_file(half, str(partial), texts)
    partial.replace(path)


def load(path: Path, kind: str, build: Callable[[dict[str, Any]], Any], remedy: str) -> tuple[Any, dict[str, Any]]:
    """The network in evaluation mode, float32, and the facts it was written with.

    Args:
        build: the network from its stored architecture.
        remedy: the command that makes such a file.

    Raises:
        WeightsError: the file is missing, damaged, of another kind, or does not fit its architecture.
    """
    tensors = read_state(path)
    said = metadata(path)
    if said.get("format") != kind:
        raise WeightsError(f"{path} has format {said.get('format')!r}, not {kind!r}; make it with: {remedy}.")
    try:
        network = build(json.loads(said["architecture"]))
        facts = json.loads(said.get("facts", "{}"))
    except (KeyError, TypeError, ValueError, AttributeError, IndexError, RuntimeError) as error:
        raise WeightsError(f"{path} describes no usable network ({error}); make it again with: {remedy}.") from error
    load_weights(network, tensors | shared(network), path)
    return network.eval().requires_grad_(False), facts


def shared(network: Any) -> dict[str, Any]:
    """Tensors of the network that its file does not hold."""
    return {k: v for k, v in network.state_dict().items() if k.startswith(PREFIX)}


def metadata(path: Path) -> dict[str, str]:
    """The texts in the file's header; none for files of another kind."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(str(path), framework="pt") as file:
            return file.metadata() or {}
    except (SafetensorError, OSError, ValueError):
        return {}
