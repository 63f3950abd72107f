"""From a training run to the weights that ship."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

from safetensors import SafetensorError

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.bundled.network import BundledNetwork
from materialist.predict.weights import metadata, sha256
from materialist.train import checkpoint
from materialist.train.bundled import BundledTask


def export_run(run: Path, output: Path, *, average_with: Path | None = None, force: bool = False) -> dict[str, Any]:
    """Write the averaged weights of a run of `train matnet` as a float16 .safetensors file.

    average_with: exported weights of the bundled network, such as those that the run began from; the mean of both is
    written, which often does better than either on unseen pictures (Wortsman et al. 2022, "Model soups").

    Returns step, minutes, megabytes, hash. Raises WeightsError without a checkpoint, or for weights of another network,
    InputError for another kind of file or of run, OutputError when `output` exists.
    """
    if output.suffix != ".safetensors":
        raise InputError(f"The weights are a .safetensors file, not {output.name}.")
    if output.exists() and not force:
        raise OutputError(f"{output} exists; choose another name, or add --force to replace it.")
    task, own = checkpoint.load(run, BundledTask.kind)["task"], run / checkpoint.WEIGHTS
    if average_with is not None and task["name"] != BundledTask.name:
        raise InputError("--average-with is for the bundled network; leave it out for the paper's.")
    try:
        if average_with is None:
            shutil.copyfile(own, output)
        else:
            _save_mean(own, average_with, output)
    except (OSError, SafetensorError) as error:
        raise OutputError(f"The weights cannot be written to {output}: {error}.") from error
    facts = json.loads(metadata(own)["facts"])
    size, digest = output.stat().st_size / 1e6, sha256(output)[:16]
    return {"step": facts["step"], "minutes": facts["minutes"], "megabytes": size, "hash": digest}


def _save_mean(own: Path, other: Path, output: Path) -> None:
    """The mean of two exported files of one network; its scores are those of neither."""
    if not other.is_file():
        raise WeightsError(f"There are no weights at {other}; give a file of materialist train export.")
    (network, facts), (second, _) = BundledNetwork.load(own), BundledNetwork.load(other)
    ours, theirs = network.architecture.as_dict(), second.architecture.as_dict()
    if differing := [name for name in ours if ours[name] != theirs[name]]:
        raise WeightsError(f"{other} and the run differ in {', '.join(differing)}; give weights of the same network.")
    for mine, its in zip(network.parameters(), second.parameters(), strict=True):
        mine.lerp_(its, 0.5)
    facts["scores of the run"] = facts.pop("scores")
    network.save(output, facts | {"averaged with": sha256(other)[:16]})
