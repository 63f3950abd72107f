"""The state of a training run on disk: written whole or not at all, so that a killed run goes on."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.io.beside import make_folder

NAME = "checkpoint.pt"
VERSION = 1
OR = " or "
"""Between the kinds that a checkpoint may be of, where it does not say."""


def save(folder: Path, state: dict[str, Any]) -> None:
    """Write the state (tensors, numbers, texts, and lists and dicts of them) to FOLDER/checkpoint.pt.

    `kind` in it is the command whose run it is: 'matnet', 'clicks' or 'refraction'.
    """
    partial = folder / (NAME + ".part")
    try:
        torch.save({"version": VERSION, **state}, partial)
        partial.replace(folder / NAME)
    except (OSError, RuntimeError) as error:
        partial.unlink(missing_ok=True)
        raise OutputError(f"The checkpoint cannot be written to {folder}: {error}.") from error


def there(folder: Path) -> bool:
    """Whether FOLDER holds a run to go on with."""
    return (folder / NAME).is_file()


def begun(folder: Path, kind: str, *, resume: bool, device: Any = "cpu") -> dict[str, Any] | None:
    """The state to go on from; None where FOLDER holds no run.

    Raises OutputError when it holds one and `resume` is off, else as `load` does.
    """
    if not there(folder):
        return None
    if not resume:
        raise OutputError(f"{folder} holds a run already; add --resume to go on with it, or choose another folder.")
    return load(folder, device, kind)


def make(folder: Path) -> None:
    """Make the folder of a run, where it is not there; raises OutputError when it cannot be made."""
    try:
        make_folder(folder)
    except OSError as error:
        raise OutputError(f"{folder} cannot be made ({error.strerror or error}); choose another folder.") from error


def load(folder: Path, device: Any = "cpu", kind: str | None = None) -> dict[str, Any]:
    """The state in FOLDER/checkpoint.pt.

    Raises WeightsError when there is none or it is damaged, InputError when it is of another kind, if one is given.
    """
    path = folder / NAME
    if not path.is_file():
        raise WeightsError(
            f"{folder} holds no {NAME}; give the folder of a run of: materialist train {kind or 'matnet'}."
        )
    try:
        state = torch.load(path, map_location=device, weights_only=True)
    except Exception as error:  # torch raises what its unpickler or zip reader raises
        reason = str(error).splitlines()[0][:200] if str(error) else type(error).__name__
        raise WeightsError(f"{path} is damaged ({reason}); start the run anew in another folder.") from error
    if not isinstance(state, dict) or state.get("version") != VERSION:
        raise WeightsError(f"{path} is no checkpoint of this version; start the run anew in another folder.")
    # Those of matnet have a recipe; that tells, where no kind is written.
    found = state.get("kind") or ("matnet" if "recipe" in state else "clicks" + OR + "refraction")
    if kind is not None and kind not in found.split(OR):
        raise InputError(f"{folder} holds a run of `train {found}`, not of `train {kind}`; choose another folder.")
    return state


def append_line(path: Path, values: dict[str, Any]) -> None:
    """Add one line of JSON to a curve file."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(values) + "\n")


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The lines of a curve file; none when it is not there. A last line that was cut off is left out."""
    found = []
    for line in path.read_text("utf-8").splitlines() if path.is_file() else []:
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found
