"""Networks on a model hub: their names, their folders on this machine, and their download.

Only `download` uses the network, and only `materialist models download` calls it.
"""

import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.weights import CHECKSUMS, INSTEAD, reason, sha256

WEIGHTS = (".safetensors", ".pth", ".pt", ".bin", ".ckpt")
SETTINGS = (".json", ".txt", ".model")
"""Configurations and vocabularies, which a pipeline needs beside its weights."""
TIMEOUT = 10.0
"""Seconds without an answer after which the hub counts as out of reach."""


@dataclass(frozen=True)
class HubModel:
    """A network on a model hub."""

    name: str
    """What `materialist models` calls it."""
    repo: str
    """owner/name on the hub."""
    main_file: str
    """A file that a complete download has; "" where that is not known."""
    purpose: str
    licence: str
    megabytes: int
    """What a download takes, about."""
    instead: str = INSTEAD
    """Advice for a person who cannot fetch it."""


KNOWN = (
    HubModel(
        "matnet",
        "Lez/MatNet",
        "matnet_weights.pth",
        "the paper's network: all maps",
        "not stated: ask its authors",
        434,
    ),
    HubModel(
        "marigold-appearance",
        "prs-eth/marigold-iid-appearance-v1-1",
        "model_index.json",
        "albedo, roughness, metallic",
        "OpenRAIL++",
        2600,
    ),
    HubModel(
        "marigold-normals",
        "prs-eth/marigold-normals-v1-1",
        "model_index.json",
        "normals",
        "OpenRAIL++",
        2600,
    ),
    HubModel(
        "marigold-depth",
        "prs-eth/marigold-depth-v1-1",
        "model_index.json",
        "depth",
        "OpenRAIL++",
        2600,
    ),
    HubModel(
        "depth-anything",
        "depth-anything/Depth-Anything-V2-Small-hf",
        "config.json",
        "depth",
        "Apache-2.0",
        100,
    ),
)
"""By name; any other repository of the same kind can be named by its id, owner/name."""


def models_folder() -> Path:
    """Where downloads lie: $MATERIALIST_MODELS, else materialist/models in the user's cache folder."""
    if folder := os.environ.get("MATERIALIST_MODELS"):
        return Path(folder)
    return (
        Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "materialist" / "models"
    )


def is_hub_id(text: str) -> bool:
    """Whether `text` reads as owner/name and not as a file."""
    return (
        bool(re.fullmatch(r"[\w.-]+/[\w.-]+", text))
        and not text.startswith(".")
        and not text.endswith(WEIGHTS)
    )


def hub_model(name: str) -> HubModel:
    """The model of that name or hub id. Raises InputError, naming the known ones."""
    for model in KNOWN:
        if name in (model.name, model.repo):
            return model
    if is_hub_id(name):
        licence = "see its page on the hub"
        return HubModel(name, name, "", "given by its id", licence, 0, "do without it")
    known = ", ".join(model.name for model in KNOWN)
    raise InputError(
        f"There is no model '{name}'; choose one of {known}, or give a hub id as owner/name."
    )


def folder_of(model: HubModel) -> Path:
    """Where a download of the model lies, or would."""
    return models_folder() / model.repo.replace("/", "--")


def is_complete(model: HubModel) -> bool:
    """Whether a download of it finished here: the list of checksums is written last."""
    return (folder_of(model) / CHECKSUMS).is_file()


def downloaded() -> dict[str, Path]:
    """The folders of all finished downloads here, by the model's name or hub id."""
    folders = {
        file.parent.name: file.parent for file in sorted(models_folder().glob(f"*/{CHECKSUMS}"))
    }
    known = {folder_of(model).name: model.name for model in KNOWN}
    return {known.get(name, name.replace("--", "/", 1)): folder for name, folder in folders.items()}


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


def locate(where: str, default: str) -> Path:
    """A file or folder as it is, else the download of a model's name or hub id, or of `default` where that is "".

    Raises WeightsError when it is not there; nothing is downloaded.
    """
    path = Path(where).expanduser()
    named = any(where == model.name for model in KNOWN)
    if where and not named and path.exists():
        return path
    if where and not named and not is_hub_id(where):
        raise WeightsError(
            f"There is no folder or no file {where} with a model; give one, or a hub id as owner/name, or fetch the "
            f"published one (materialist models download {default or 'NAME'}); or {INSTEAD}."
        )
    return require(hub_model(where or default))


def weights_file(path: Path) -> Path:
    """The file itself, or the weights in a folder, safetensors before pickles. Raises WeightsError for none."""
    files = (
        [path]
        if path.is_file()
        else [file for end in WEIGHTS for file in sorted(path.glob(f"*{end}"))]
    )
    if not files:
        raise WeightsError(
            f"{path} holds no .safetensors or .pth file; fetch the model again, or {INSTEAD}."
        )
    return files[0]


def download(model: HubModel, *, force: bool = False) -> Path:
    """Fetch the files that the model needs into its folder, which is returned.

    Every file is compared with the hub's own sha256 where it gives one; the list of all checksums is written last.
    An interrupted download is taken up again; `force` fetches everything again. Raises WeightsError when the hub cannot
    be reached, lacks the model, or sends other files than it promised; OutputError when the disk is full or read-only.
    """
    from huggingface_hub import HfApi

    api = HfApi(os.environ.get("HF_ENDPOINT"), library_name="materialist")
    folder = folder_of(model)
    try:
        # --- What the hub promises, and what of it is needed ---
        listing = api.model_info(model.repo, files_metadata=True, timeout=TIMEOUT).siblings or []
        promised = {file.rfilename: file.lfs.sha256 if file.lfs else None for file in listing}
        names = needed_files(promised)
        for name in names:
            api.hf_hub_download(model.repo, name, local_dir=folder, force_download=force)
            # A damaged file is deleted, or the next try would take it for complete.
            if promised[name] not in (None, sha256(folder / name)):
                (folder / name).unlink()
                raise ValueError(f"{name} came damaged: its sha256 is not {promised[name]}")
    except Exception as error:  # several HTTP libraries raise their own
        if (
            isinstance(error, OSError)
            and error.errno is not None
            and not isinstance(error, ConnectionError)
        ):
            raise _unwritable(folder, error) from error
        raise WeightsError(
            f"{model.repo} cannot be fetched from {api.endpoint} ({reason(error)}); run the same command again, or "
            f"fetch {model.main_file or 'its files'} elsewhere into a folder and take them from there: materialist "
            f"models download {model.name} --from FOLDER; or {model.instead}."
        ) from error
    if not any(name.endswith(WEIGHTS) for name in names):
        raise WeightsError(f"{api.endpoint}/{model.repo} holds no file of weights; check the id.")
    _write_checksums(folder, names)
    return folder


def adopt(model: HubModel, source: Path) -> Path:
    """As `download`, of files that were fetched elsewhere into the folder `source`; the hub is not asked.

    Raises InputError where the folder lacks the model's files, OutputError when the disk is full or read-only.
    """
    names = needed_files(
        path.relative_to(source).as_posix() for path in sorted(source.rglob("*")) if path.is_file()
    )
    if not any(name.endswith(WEIGHTS) for name in names) or model.main_file not in ("", *names):
        raise InputError(
            f"{source} lacks {model.main_file or 'a file of weights'} of {model.repo}; fetch it again."
        )
    folder = folder_of(model)
    try:
        for name in names if source.resolve() != folder.resolve() else ():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source / name, folder / name)
    except OSError as error:
        raise _unwritable(folder, error) from error
    _write_checksums(folder, names)
    return folder


def needed_files(names: Iterable[str]) -> list[str]:
    """The needed files of a repository: all settings, and of the weights of each folder the best of several formats.

    Half precision before full (it is the same network at half the size), safetensors before pickles.
    """
    names = [name for name in names if not name.startswith(".cache/")]
    picked = [name for name in names if name.endswith(SETTINGS)]
    weights = [name for name in names if name.endswith(WEIGHTS)]
    for folder in dict.fromkeys(PurePosixPath(name).parent for name in weights):
        files = [name for name in weights if PurePosixPath(name).parent == folder]
        # The first ending that any file has; its whole group, as weights may be split into
        # several files.
        ends = (".fp16.safetensors", ".safetensors", ".fp16.bin", *WEIGHTS)
        picked += next(
            group for end in ends if (group := [name for name in files if name.endswith(end)])
        )
    return picked


def _write_checksums(folder: Path, names: Iterable[str]) -> None:
    """Write the list for these files of the folder; a download without it is not complete."""
    lines = [f"{sha256(folder / name)}  {name}\n" for name in sorted(names)]
    (folder / CHECKSUMS).write_text("".join(lines), "utf-8")


def _unwritable(folder: Path, error: OSError) -> OutputError:
    return OutputError(
        f"{folder} cannot be written ({error.strerror or error}); free space or set MATERIALIST_MODELS."
    )
