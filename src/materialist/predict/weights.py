"""Files of weights: checksums, reading without running code, writing, and loading into a network that fits exactly."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.errors import WeightsError
from materialist.io.atomic import whole_file

if TYPE_CHECKING:
    from torch import Tensor, nn

INSTEAD = 'use another predictor (`predictor="auto"`), or read another tool\'s maps with `predictor="maps:DIR"`'
"""Advice for a person who lacks the network in question."""
SCALE = ".scale"
"""Suffix of the scales of a tensor that is stored as int8."""
CHECKSUMS = "SHA256SUMS"
"""List beside every download and every ONNX file: one line a file, as `sha256sum` writes and checks them."""
FETCH = f"fetch it again (materialist models download NAME --force), or {INSTEAD}"
"""What to do about a damaged download."""


def sha256(path: Path) -> str:
    """Hex digest of a file. Raises WeightsError when it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise WeightsError(
            f"{path} cannot be read ({error.strerror or error}); give a file of weights."
        ) from error


def verify_file(path: Path, expected: str = "", remedy: str = FETCH) -> str:
    """The file's sha256, which must be `expected`, or the digest in the list beside the file where that names it.

    Raises WeightsError, with both digests and the remedy, when they differ.
    """
    digest = sha256(path)
    expected = expected or _listed(path.parent).get(path.name, digest)
    if expected != digest:
        raise WeightsError(
            f"{path} is damaged: its sha256 is {digest}, expected {expected}; {remedy}."
        )
    return digest


def verify_folder(folder: Path) -> str:
    """One sha256 for a whole download, after every file of its list was found and verified. Raises WeightsError."""
    listed = _listed(folder)
    if not listed:
        raise WeightsError(
            f"{folder} has no list of checksums ({CHECKSUMS}); fetch the model again."
        )
    for name, digest in listed.items():
        if not (folder / name).is_file():
            raise WeightsError(
                f"{folder} lacks {name}; fetch the model again (materialist models download)."
            )
        verify_file(folder / name, digest)
    return hashlib.sha256(
        "\n".join(f"{listed[n]} {n}" for n in sorted(listed)).encode()
    ).hexdigest()


def _listed(folder: Path) -> dict[str, str]:
    """File name (relative to the folder) -> sha256, from the list beside a download; empty when there is none."""
    try:
        lines = (folder / CHECKSUMS).read_text("utf-8").splitlines()
    except (OSError, UnicodeDecodeError):
        return {}
    pairs = (line.split(maxsplit=1) for line in lines if len(line.split(maxsplit=1)) == 2)
    return {name.lstrip("*"): digest.lower() for digest, name in pairs}


def read_state(path: Path) -> dict[str, Tensor]:
    """The tensors of a .safetensors file or a PyTorch checkpoint, on the CPU; no code in the file is ever run.

    A dict in a dict (`state_dict`, `model`) is opened, a leading `module.` of multi-GPU training dropped; int8 tensors
    with a scale for each output (NAME and NAME.scale) come as float32. Raises
    WeightsError for a missing, empty, truncated or damaged file, and for one that holds anything but tensors.
    """
    import torch
    from safetensors.torch import load_file

    if not path.is_file() or path.stat().st_size == 0:
        kind = (
            "is empty" if path.is_file() else "is a folder" if path.is_dir() else "does not exist"
        )
        raise WeightsError(
            f"{path} {kind}; give a .safetensors or .pth file of weights, or {INSTEAD}."
        )
    try:
        # `weights_only`: a pickle can run code, and is refused unless it holds plain tensors.
        safe = path.suffix == ".safetensors"
        content = (
            load_file(path) if safe else torch.load(path, map_location="cpu", weights_only=True)
        )
    except MemoryError:
        raise
    except Exception as error:  # damaged files fail in whatever part of the reader meets them first
        if out_of_memory(error):
            raise MemoryError(f"There is not enough memory to read {path}.") from error
        raise WeightsError(
            f"{path} is truncated or damaged, or wants to run code, which is refused ({reason(error)}); "
            f"fetch or copy it again, or {INSTEAD}."
        ) from error
    # --- Checkpoints of training wrap the tensors; nothing but tensors may be left ---
    for key in ("state_dict", "model"):
        if isinstance(content, Mapping) and isinstance(content.get(key), Mapping):
            content = content[key]
    if not isinstance(content, Mapping) or not all(
        isinstance(value, torch.Tensor) for value in content.values()
    ):
        raise WeightsError(f"{path} holds more than named tensors; it is no plain file of weights.")
    state = {str(name).removeprefix("module."): tensor for name, tensor in content.items()}
    # --- Levels times scales ---
    for name in [name for name in state if f"{name}{SCALE}" in state]:
        scale = state.pop(f"{name}{SCALE}")
        if scale.numel() != (state[name].shape or [1])[0]:
            raise WeightsError(
                f"{path} is damaged: {name} has the shape {list(state[name].shape)} and {scale.numel()} scales, and "
                f"needs one for each output; fetch or copy it again, or {INSTEAD}."
            )
        state[name] = state[name] * scale.reshape(-1, *[1] * (state[name].ndim - 1))
    return state


def out_of_memory(error: Exception) -> bool:
    """Whether an error of torch or safetensors means that there is no memory left."""
    words = ("not enough memory", "can't allocate memory", "Cannot allocate memory", "bad_alloc")
    return any(word in str(error) for word in words)


def load_weights(network: nn.Module, state: Mapping[str, Tensor], path: Path) -> None:
    """Put `state`, read from `path`, into the network: every tensor there, none else, all shapes right, all finite.

    Raises WeightsError that names what is missing, what is too much, and what has another shape.
    """
    try:
        network.load_state_dict(state, strict=True)
    except RuntimeError as error:
        faults = " ".join(line.strip()[:200] for line in str(error).splitlines()[1:4])
        raise WeightsError(
            f"{path} is not a checkpoint of {type(network).__name__}: {faults}"
        ) from error
    # Finite on purpose: one NaN spreads over every pixel.
    broken = [
        name
        for name, tensor in state.items()
        if tensor.is_floating_point() and not tensor.isfinite().all()
    ]
    if broken:
        raise WeightsError(
            f"{path} has NaN or infinite values in {broken[0]}; fetch or train it again."
        )


def write_weights(path: Path, tensors: Mapping[str, Tensor], texts: dict[str, str]) -> None:
    """Write tensors as float16, with `texts` in the header, whole or not at all."""
    import torch
    from safetensors.torch import save

    half = {
        name: tensor.detach().cpu().to(torch.float16).contiguous()
        for name, tensor in tensors.items()
    }
    with whole_file(path, force=True) as file:
        # Files that safetensors itself writes can be read by their owner alone.
        file.write_bytes(save(half, texts))


def metadata(path: Path) -> dict[str, str]:
    """The texts in the header of a .safetensors file; empty for other files."""
    from safetensors import SafetensorError, safe_open

    with (
        suppress(SafetensorError, OSError, ValueError),
        safe_open(str(path), framework="pt") as file,
    ):
        return file.metadata() or {}
    return {}


def reason(error: Exception) -> str:
    """The first line of what a library says."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
