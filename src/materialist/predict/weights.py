"""Files of weights: checked by checksum, read without running code, and compared with what a network needs."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.errors import WeightsError
from materialist.predict.models import CHECKSUMS, INSTEAD

if TYPE_CHECKING:
    from torch import Tensor, nn

SHOWN = 4
"""Tensors that a message names before it only counts."""
WRAPPERS = ("state_dict", "model_state_dict", "model", "network")
"""Keys under which training scripts put the tensors."""


def sha256(path: Path) -> str:
    """Hex digest of a file. Raises WeightsError when it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise WeightsError(f"{path} cannot be read ({error.strerror or error}); give a file of weights.") from error


def read_checksums(folder: Path) -> dict[str, str]:
    """File name (relative to the folder) -> sha256, from the list beside a download; empty when there is none."""
    try:
        lines = (folder / CHECKSUMS).read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    pairs = (line.split(maxsplit=1) for line in lines if len(line.split(maxsplit=1)) == 2)
    return {name.lstrip("*"): digest.lower() for digest, name in pairs}


def verify_file(path: Path, name: str | None = None, folder: Path | None = None) -> str:
    """The file's sha256, which must be the one in the list beside it when that names it.

    `name` is the file's name in the list of `folder`; without them, its own name in its own folder.
    Raises WeightsError, with both digests, when they differ.
    """
    digest = sha256(path)
    expected = read_checksums(folder or path.parent).get(name or path.name)
    if expected and expected != digest:
        raise WeightsError(
            f"{path} is damaged: its sha256 is {digest}, expected {expected}; fetch it again "
            f"(materialist models download NAME --force), or {INSTEAD}."
        )
    return digest


def verify_folder(folder: Path) -> str:
    """One sha256 for a whole download, after every file of its list was found and verified. Raises WeightsError."""
    listed = read_checksums(folder)
    if not listed:
        raise WeightsError(f"{folder} has no list of checksums ({CHECKSUMS}); fetch the model again.")
    missing = [name for name in listed if not (folder / name).is_file()]
    if missing:
        raise WeightsError(f"{folder} lacks {_some(missing)}; fetch the model again (materialist models download).")
    for name in listed:
        verify_file(folder / name, name, folder)
    return hashlib.sha256("\n".join(f"{listed[n]} {n}" for n in sorted(listed)).encode()).hexdigest()


def read_state(path: Path) -> dict[str, Tensor]:
    """The tensors of a .safetensors file or a PyTorch checkpoint, on the CPU; no code in the file is ever run.

    A dict in a dict (`state_dict`, `model`, ...) is opened, a leading `module.` of multi-GPU training dropped.
    Raises WeightsError for a missing, empty, truncated or damaged file, and for one that holds anything but tensors.
    """
    return state_of(read_content(path), path)


def read_content(path: Path) -> object:
    """What the file holds, as `state_of` takes it. Raises WeightsError for one that is missing, empty or damaged."""
    if not path.is_file() or path.stat().st_size == 0:
        kind = "is empty" if path.is_file() else "is a folder" if path.is_dir() else "does not exist"
        raise WeightsError(f"{path} {kind}; give a .safetensors or .pth file of weights, or {INSTEAD}.")
    return _read_safetensors(path) if path.suffix == ".safetensors" else _read_pickle(path)


def state_of(content: object, path: Path) -> dict[str, Tensor]:
    """The tensors of a file's content; see `read_state`."""
    import torch

    for key in WRAPPERS:
        if isinstance(content, Mapping) and isinstance(content.get(key), Mapping):
            content = content[key]
    if not isinstance(content, Mapping) or not content:
        raise WeightsError(f"{path} holds a {type(content).__name__}, not named tensors; it is no file of weights.")
    odd = [str(name) for name, value in content.items() if not isinstance(value, torch.Tensor)]
    if odd:
        raise WeightsError(f"{path} holds more than tensors ({_some(odd)}); it is no plain file of weights.")
    prefix = "module." if all(str(name).startswith("module.") for name in content) else ""
    return {str(name).removeprefix(prefix): tensor for name, tensor in content.items()}


def _read_safetensors(path: Path) -> object:
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        return load_file(path)
    except (SafetensorError, OSError, ValueError, KeyError) as error:
        raise WeightsError(_damaged(path, error)) from error


def _read_pickle(path: Path) -> object:
    import torch

    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except pickle.UnpicklingError as error:
        raise WeightsError(
            f"{path} is not a plain file of weights: it is no PyTorch checkpoint, or it wants to run code when it is "
            f"read, which is refused; save its state_dict alone, or {INSTEAD}."
        ) from error
    except Exception as error:  # damaged files fail in whatever part of the reader meets them first
        raise WeightsError(_damaged(path, error)) from error


def _damaged(path: Path, error: Exception) -> str:
    reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:160]
    return f"{path} is truncated or damaged ({reason}); fetch or copy it again, or {INSTEAD}."


def load_weights(network: nn.Module, state: Mapping[str, Tensor], path: Path) -> None:
    """Put `state`, read from `path`, into the network: every tensor there, none else, all shapes right, all finite.

    Raises WeightsError that names what is missing, what is too much, and what has another shape.
    """
    needed = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    faults = []
    if missing := [name for name in needed if name not in state]:
        faults.append(f"lacks {_some(missing)}")
    if extra := [name for name in state if name not in needed]:
        faults.append(f"has the unknown {_some(extra)}")
    shapes = {name: tuple(state[name].shape) for name in needed if name in state}
    if odd := [f"{name} {list(s)} instead of {list(needed[name])}" for name, s in shapes.items() if s != needed[name]]:
        faults.append(f"has {_some(odd)}")
    if faults:
        raise WeightsError(
            f"{path} is not a checkpoint of {type(network).__name__} ({len(needed)} tensors): it {', '.join(faults)}."
        )
    broken = [name for name, tensor in state.items() if tensor.is_floating_point() and not tensor.isfinite().all()]
    if broken:
        raise WeightsError(f"{path} has NaN or infinite values in {_some(broken)}; fetch or train it again.")
    network.load_state_dict({name: tensor.float() for name, tensor in state.items()}, strict=True)


def _some(names: list[str]) -> str:
    """The first few names, and how many more."""
    shown = ", ".join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"
