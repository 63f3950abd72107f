"""From a training run to the weights that ship."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from materialist.errors import InputError, OutputError
from materialist.predict.bundled.network import Architecture, BundledNetwork
from materialist.predict.bundled.weights import save
from materialist.predict.matnet.predictor import FORMAT
from materialist.predict.own_weights import write
from materialist.predict.weights import sha256
from materialist.train import checkpoint
from materialist.train.trainer import KIND, SCORES


def export_run(run: Path, output: Path, *, force: bool = False) -> dict[str, Any]:
    """Write the weights of a run of `train matnet` as float16 .safetensors, of a bundled one the averaged ones.

    Returns step, minutes, megabytes, hash. Raises WeightsError without a checkpoint, InputError for another kind of
    file or of run, OutputError when `output` exists.
    """
    if output.suffix != ".safetensors":
        raise InputError(f"The weights are a .safetensors file, not {output.name}.")
    if output.exists() and not force:
        raise OutputError(f"{output} exists; choose another name, or add --force to replace it.")
    state = checkpoint.load(run, kind=KIND)
    tensors = state["averaged" if state["recipe"]["ema"] else "network"]
    scores = checkpoint.read_lines(run / SCORES)
    facts = {
        "step": state["step"],
        "minutes": round(state["seconds"] / 60, 1),
        "pictures": state["step"] * state["recipe"]["batch"],
        "recipe": state["recipe"],
        "data": state["data"],
        "scores": scores[-1] if scores else {},
    }
    from safetensors import SafetensorError

    try:
        if state["recipe"]["task"] == "paper":
            write(output, tensors, {"format": FORMAT, "facts": json.dumps(facts)})
        else:
            network = BundledNetwork(Architecture.from_dict(state["recipe"]["network"]))
            network.load_state_dict(tensors)
            save(output, network, facts)
    except (OSError, SafetensorError) as error:  # the writer has its own for a folder that is not there
        raise OutputError(f"The weights cannot be written to {output}: {error}.") from error
    return {
        "step": state["step"],
        "minutes": facts["minutes"],
        "megabytes": output.stat().st_size / 1e6,
        "hash": sha256(output)[:16],
    }
