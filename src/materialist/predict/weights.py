"""Files of weights: checksums, reading without running code, writing, and loading into a network that fits exactly."""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.errors import WeightsError

if TYPE_CHECKING:
    from torch import Tensor, nn

INSTEAD = "use another predictor (--predictor auto), or read another tool's maps with --predictor maps:DIR"
"""Advice for a person who lacks the network in question."""
CHECKSUMS = "SHA256SUMS"
"""List beside every download: one line a file, as `sha256sum` writes and checks them."""
SHOWN = 4
"""Names of tensors or files in a message before it only counts them."""
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


def write_checksums(folder: Path, names: Iterable[str]) -> None:
    """Write the list for these files of the folder; a download without it is not complete."""
    lines = [f"{sha256(folder / name)}  {name}\n" for name in sorted(names)]
    (folder / CHECKSUMS).write_text("".join(lines), "utf-8")


def verify_file(path: Path, expected: str | None = None) -> str:
    """The file's sha256, which must be `expected`, or the digest in the list beside the file where that names it.

    Raises WeightsError, with both digests, when they differ.
    """
    digest = sha256(path)
    expected = expected or read_checksums(path.parent).get(path.name)
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
    for name, digest in listed.items():
        verify_file(folder / name, digest)
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


def write_weights(path: Path, tensors: Mapping[str, Tensor], texts: dict[str, str]) -> None:
    """Write tensors as float16, with `texts` in the header, whole or not at all."""
    import torch
    from safetensors.torch import save_file

    half = {name: tensor.detach().cpu().to(torch.float16).contiguous() for name, tensor in tensors.items()}
    partial = path.with_name(path.name + ".part")
    save_file(half, str(partial), texts)
    partial.replace(path)


def metadata(path: Path) -> dict[str, str]:
    """The texts in the header of a .safetensors file; empty for other files."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(str(path), framework="pt") as file:
            return file.metadata() or {}
    except (SafetensorError, OSError, ValueError):
        return {}


def _some(names: list[str]) -> str:
    """The first few names, and how many more."""
    shown = ", ".join(names[:SHOWN])
    return shown if len(names) <= SHOWN else f"{shown} and {len(names) - SHOWN} more"
