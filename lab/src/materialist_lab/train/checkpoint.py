"""The state of a run on disk, written whole or not at all, and the lines of its log."""

import json
from pathlib import Path
from typing import Any

import torch

from materialist.errors import InputError, OutputError, WeightsError
from materialist.io.atomic import whole_file
from materialist.predict.weights import reason

NAME = "checkpoint.pt"
VERSION = 3
WEIGHTS = "weights.safetensors"
"""The averaged weights, ready to use, beside the checkpoint."""
CURVE = "curve.jsonl"
"""Means of the losses, a JSON object a line."""
SCORES = "scores.jsonl"
"""Scores on what is never trained on, a JSON object a line."""


def save(folder: Path, state: dict[str, Any]) -> None:
    """Write the state (tensors, plain values, lists and dicts of them) to FOLDER/checkpoint.pt.

    state["kind"] is the command whose run it is: 'matnet', 'clicks' or 'refraction'. Raises OutputError.
    """
    try:
        with whole_file(folder / NAME, force=True) as file:
            torch.save({"version": VERSION, **state}, file)
    except RuntimeError as error:  # torch's own, of a full disk
        raise OutputError(f"The checkpoint cannot be written to {folder}: {error}.") from error


def load(
    folder: Path, kind: str, *, resume: bool = True, device: Any = "cpu"
) -> dict[str, Any] | None:
    """The state in FOLDER/checkpoint.pt to go on from; None where FOLDER holds no run.

    Raises OutputError when it holds one and `resume` is off, WeightsError when that is damaged, InputError when it is
    of another kind.
    """
    path = folder / NAME
    if not path.is_file():
        return None
    if not resume:
        raise OutputError(
            f"{folder} holds a run already; add --resume to go on with it, or choose another folder."
        )
    try:
        state = torch.load(path, map_location=device, weights_only=True)
    except Exception as error:  # torch raises whatever its unpickler or zip reader raises
        raise WeightsError(
            f"{path} is damaged ({reason(error)}); start the run anew in another folder."
        ) from error
    if not isinstance(state, dict) or state.get("version") != VERSION:
        raise WeightsError(
            f"{path} is no checkpoint of this version; start the run anew in another folder."
        )
    if state["kind"] != kind:
        raise InputError(
            f"{folder} holds a run of `train {state['kind']}`, not of `train {kind}`; choose another."
        )
    return state


def append_line(path: Path, values: dict[str, Any]) -> None:
    """Add one line of JSON to a log."""
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(values) + "\n")
