"""Weights of the bundled network: one .safetensors file, float16, that says what it is."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from materialist.errors import WeightsError
from materialist.predict.bundled.network import Architecture, BundledNetwork

FORMAT = "materialist-bundled-1"
"""What the file's metadata calls itself; another number is another network."""


def save_weights(path: Path, network: BundledNetwork, facts: dict[str, Any]) -> None:
    """Write the network as float16 with its architecture and `facts` (steps, data seed, scores) in the metadata."""
    from safetensors.torch import save_file

    tensors = {k: v.detach().cpu().to(torch.float16).contiguous() for k, v in network.state_dict().items()}
    architecture = json.dumps(network.architecture.as_dict())
    metadata = {"format": FORMAT, "architecture": architecture, "facts": json.dumps(facts)}
    partial = path.with_name(path.name + ".part")
    save_file(tensors, str(partial), metadata)
    partial.replace(path)


def load_weights(path: Path) -> tuple[BundledNetwork, dict[str, Any]]:
    """The network in evaluation mode, float32, and the facts it was written with.

    Raises WeightsError when the file is missing, damaged, of another format, or does not fit its architecture.
    """
    tensors, metadata = _read(path)
    if metadata.get("format") != FORMAT:
        raise WeightsError(
            f"{path} has format {metadata.get('format')!r}, not {FORMAT!r}; write it with: materialist train export."
        )
    try:
        network = BundledNetwork(Architecture.from_dict(json.loads(metadata["architecture"])))
        facts = json.loads(metadata.get("facts", "{}"))
    except (KeyError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        raise WeightsError(f"{path} describes no usable network ({error}); write it again.") from error
    check_tensors(path, tensors, network.state_dict())
    network.load_state_dict({k: v.float() for k, v in tensors.items()})
    return network.eval().requires_grad_(False).to(memory_format=torch.channels_last), facts  # type: ignore[call-overload]


def check_tensors(path: Path, found: dict[str, Tensor], expected: dict[str, Tensor]) -> None:
    """Raises WeightsError naming tensors that are missing, extra, misshapen or not finite."""
    wrong = []
    for word, names in (("missing", expected.keys() - found.keys()), ("unknown", found.keys() - expected.keys())):
        if names:
            wrong.append(f"{len(names)} {word} (such as {min(names)})")
    shapes = [k for k in sorted(expected.keys() & found.keys()) if found[k].shape != expected[k].shape]
    if shapes:
        k = shapes[0]
        wrong.append(f"{len(shapes)} misshapen (such as {k}: {list(found[k].shape)}, not {list(expected[k].shape)})")
    broken = [k for k in sorted(found) if not bool(torch.isfinite(found[k]).all())]
    if broken:
        wrong.append(f"{len(broken)} with NaN or infinite values (such as {broken[0]})")
    if wrong:
        raise WeightsError(f"{path} does not fit the network: tensors {'; '.join(wrong)}. Install the package again.")


def file_hash(path: Path) -> str:
    """The first 16 hexadecimal digits of the file's SHA-256: which weights a scene was made with."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


def _read(path: Path) -> tuple[dict[str, Tensor], dict[str, str]]:
    from safetensors import SafetensorError, safe_open

    if not path.is_file():
        raise WeightsError(f"There are no weights at {path}; use --predictor classical, or install the package again.")
    try:
        with safe_open(str(path), framework="pt") as file:
            return {name: file.get_tensor(name) for name in file.keys()}, file.metadata() or {}  # noqa: SIM118
    except (SafetensorError, OSError, ValueError) as error:
        raise WeightsError(f"{path} is damaged ({error}); install the package again.") from error
