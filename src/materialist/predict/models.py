"""The networks that can be fetched from a model hub, and where they lie on this machine.

Nothing here touches the network: `download` does, and only `materialist models download` calls it.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path

from materialist.errors import InputError, WeightsError

INSTEAD = "use another predictor (--predictor auto), or read another tool's maps with --predictor maps:DIR"
"""What a person can do without the network in question."""
CHECKSUMS = "SHA256SUMS"
"""Beside every download: one line a file, as `sha256sum` writes and checks them."""


@dataclass(frozen=True)
class HubModel:
    """A network on a model hub."""

    name: str
    """What `materialist models` calls it."""
    repo: str
    """owner/name on the hub."""
    main_file: str
    """A file that a complete download has."""
    purpose: str
    licence: str
    megabytes: int
    """What a download takes, about."""


KNOWN = (
    HubModel("matnet", "Lez/MatNet", "matnet_weights.pth", "the paper's network: all maps",
             "not stated: ask its authors", 434),
    HubModel("marigold-appearance", "prs-eth/marigold-iid-appearance-v1-1", "model_index.json",
             "albedo, roughness, metallic", "OpenRAIL++", 2600),
    HubModel("marigold-normals", "prs-eth/marigold-normals-v1-1", "model_index.json", "normals", "OpenRAIL++", 2600),
    HubModel("marigold-depth", "prs-eth/marigold-depth-v1-1", "model_index.json", "depth", "OpenRAIL++", 2600),
    HubModel("depth-anything", "depth-anything/Depth-Anything-V2-Small-hf", "config.json", "depth", "Apache-2.0", 100),
    HubModel("sam2", "facebook/sam2.1-hiera-tiny", "config.json", "selections: --with sam2", "Apache-2.0", 160),
)  # fmt: skip
"""By name; any other repository of the same kind can be named by its id, owner/name."""


def models_folder() -> Path:
    """Where downloads lie: $MATERIALIST_MODELS, else materialist/models in the user's cache folder."""
    if own := os.environ.get("MATERIALIST_MODELS"):
        return Path(own)
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "materialist" / "models"


def is_hub_id(text: str) -> bool:
    """Whether `text` reads as owner/name and not as a file."""
    return bool(re.fullmatch(r"[\w.-]+/[\w.-]+", text)) and not text.startswith(".") and not _is_weights_name(text)


def hub_model(name: str) -> HubModel:
    """The model of that name or hub id. Raises InputError, naming the known ones."""
    for model in KNOWN:
        if name in (model.name, model.repo):
            return model
    if is_hub_id(name):
        return HubModel(name, name, "", "given by its id", "see its page on the hub", 0)
    known = ", ".join(model.name for model in KNOWN)
    raise InputError(f"There is no model '{name}'; choose one of {known}, or give a hub id as owner/name.")


def folder_of(model: HubModel) -> Path:
    """Where a download of the model lies, or would."""
    return models_folder() / model.repo.replace("/", "--")


def is_complete(model: HubModel) -> bool:
    """Whether a download of it finished here: the list of checksums is written last."""
    return (folder_of(model) / CHECKSUMS).is_file()


def downloaded() -> dict[str, Path]:
    """The folders of all finished downloads here, by the model's name or hub id."""
    found = {file.parent.name: file.parent for file in sorted(models_folder().glob(f"*/{CHECKSUMS}"))}
    known = {folder_of(model).name: model.name for model in KNOWN}
    return {known.get(name, name.replace("--", "/", 1)): folder for name, folder in found.items()}


def require(model: HubModel) -> Path:
    """The folder of a finished download. Raises WeightsError that says how to get it."""
    if is_complete(model):
        return folder_of(model)
    size = f", about {model.megabytes} MB" if model.megabytes else ""
    file = f"{model.main_file} of " if model.main_file else ""
    raise WeightsError(
        f"The weights of {model.name} ({file}{model.repo}{size}) are not in {folder_of(model)}; fetch them with: "
        f"materialist models download {model.name}, or {INSTEAD}."
    )


def weights_file(folder: Path, main: str = "") -> Path:
    """The one file of weights in a folder, safetensors before pickles, else the one named `main`, else the first.

    Raises WeightsError when there is none.
    """
    found = sorted(path for path in folder.glob("*") if path.is_file() and _is_weights_name(path.name))
    safe = [path for path in found if path.suffix == ".safetensors"]
    if not found:
        raise WeightsError(f"{folder} holds no .safetensors or .pth file; fetch the model again, or {INSTEAD}.")
    return min(safe or found, key=lambda path: path.name != main)


def _is_weights_name(name: str) -> bool:
    return name.endswith((".safetensors", ".pth", ".pt", ".bin", ".ckpt"))
