"""From a training run to the weights that ship."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork
from materialist.predict.matnet.predictor import FORMAT
from materialist.predict.weights import sha256, write_weights
from materialist.train import checkpoint
from materialist.train.trainer import KIND, SCORES


def export_run(run: Path, output: Path, *, average_with: Path | None = None, force: bool = False) -> dict[str, Any]:
    """Write the weights of a run of `train matnet` as float16 .safetensors, of a bundled one the averaged ones.

    average_with: exported weights of the bundled network, such as those that the run began from; the mean of both is
    written, which often does better than either on what neither has seen (Wortsman et al. 2022, "Model soups").

    Returns step, minutes, megabytes, hash. Raises WeightsError without a checkpoint, or for weights of another network,
    InputError for another kind of file or of run, OutputError when `output` exists.
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
    if average_with is not None:
        if state["recipe"]["task"] == "paper":
            raise InputError("--average-with is for the bundled network; leave it out for the paper's.")
        tensors = _mean(tensors, average_with, state["recipe"]["network"])
        facts["averaged with"] = sha256(average_with)[:16]
        facts["scores of the run"] = facts.pop("scores")  # the mean has others
    from safetensors import SafetensorError

    try:
        if state["recipe"]["task"] == "paper":
            write_weights(output, tensors, {"format": FORMAT, "facts": json.dumps(facts)})
        else:
            network = BundledNetwork(BundledArchitecture.from_dict(state["recipe"]["network"]))
            network.load_state_dict(tensors)
            network.save(output, facts)
    except (OSError, SafetensorError) as error:  # the writer has its own for a folder that is not there
        raise OutputError(f"The weights cannot be written to {output}: {error}.") from error
    return {
        "step": state["step"],
        "minutes": facts["minutes"],
        "megabytes": output.stat().st_size / 1e6,
        "hash": sha256(output)[:16],
    }


def _mean(tensors: dict[str, Any], path: Path, network: dict[str, Any]) -> dict[str, Any]:
    """Tensors half way to those in an exported file of the same network."""
    if not path.is_file():
        raise WeightsError(f"There are no weights at {path}; give a file of materialist train export.")
    other, _ = BundledNetwork.load(path)
    own = BundledArchitecture.from_dict(network)
    if other.architecture != own:
        differing = [n for n, value in own.as_dict().items() if other.architecture.as_dict()[n] != value]
        raise WeightsError(f"{path} and the run differ in {', '.join(differing)}; give weights of the same network.")
    theirs = other.state_dict()
    half = lambda a, b: ((a.float() + b.float()) / 2).to(a.dtype) if a.dtype.is_floating_point else a  # noqa: E731
    return {name: half(tensor, theirs[name]) for name, tensor in tensors.items()}
