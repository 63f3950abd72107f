"""Networks on a model hub: their names, their folders on this machine, and their download.

Only `download` uses the network, and only `materialist models download` calls it.
"""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.weights import CHECKSUMS, INSTEAD, read_checksums, sha256, write_checksums

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


def download(
    model: HubModel, *, force: bool = False, progress: Callable[[str, int, int], None] | None = None
) -> tuple[Path, int]:
    """Fetch the files that the model needs into its folder; returns the folder and the bytes fetched now.

    Every file is compared with the hub's own sha256 where it gives one; the list of all checksums is written last.
    An interrupted download is taken up again; `force` fetches everything again. Raises WeightsError when the hub
    cannot be reached, has no such model, or sends other files than it promised; OutputError when the disk is full or
    read-only.
    """
    from huggingface_hub import HfApi

    folder, fetched = folder_of(model), _Fetched(progress)
    with _hub_errors(model):
        api = HfApi(endpoint=endpoint(), library_name="materialist")
        listing = api.model_info(model.repo, files_metadata=True, timeout=TIMEOUT).siblings or []
        promised = {file.rfilename: file.lfs.sha256 if file.lfs else None for file in listing}
        wanted, known = chosen(promised), read_checksums(folder)
        if not any(name.endswith(WEIGHTS) for name in wanted):
            raise WeightsError(f"{endpoint()}/{model.repo} holds no file of weights; check the id.")
        for name in wanted:
            file = folder / name
            damaged = file.is_file() and name in known and sha256(file) != known[name]
            api.hf_hub_download(
                model.repo, name, local_dir=folder, force_download=force or damaged, tqdm_class=fetched.bar(name)
            )
            if promised[name] not in (None, digest := sha256(file)):
                file.unlink()
                raise WeightsError(
                    f"{name} came damaged from {endpoint()}/{model.repo}: sha256 {digest}, expected {promised[name]}; "
                    "run the same command again."
                )
        write_checksums(folder, wanted)
    return folder, fetched.bytes


def adopt(model: HubModel, source: Path) -> tuple[Path, int]:
    """As `download`, of files that were fetched elsewhere into the folder `source`; the hub is not asked.

    Raises InputError where the folder lacks the model's files, OutputError when the disk is full or read-only.
    """
    if not source.is_dir():
        raise InputError(f"There is no folder {source}; give the one that holds the files of {model.repo}.")
    wanted = chosen(path.relative_to(source).as_posix() for path in sorted(source.rglob("*")) if path.is_file())
    needed = {model.main_file} - {""} if not model.main_file.endswith(WEIGHTS) else set()
    if not any(name.endswith(WEIGHTS) for name in wanted) or not needed <= set(wanted):
        raise InputError(f"{source} lacks {model.main_file or 'a file of weights'} of {model.repo}; fetch it again.")
    folder = folder_of(model)
    with _hub_errors(model):
        for name in wanted:
            target = folder / name
            target.parent.mkdir(parents=True, exist_ok=True)
            if not (target.is_file() and target.samefile(source / name)):
                partial = target.with_name(target.name + ".partial")
                shutil.copyfile(source / name, partial)
                partial.replace(target)
        write_checksums(folder, wanted)
    return folder, sum((folder / name).stat().st_size for name in wanted)


def endpoint() -> str:
    """The hub: $HF_ENDPOINT, else huggingface.co."""
    return os.environ.get("HF_ENDPOINT", "https://huggingface.co").rstrip("/")


def chosen(names: Iterable[str]) -> list[str]:
    """The needed files of a repository: all settings, and of the weights of each folder the best of several formats.

    Half precision before full (it is the same network at half the size), safetensors before pickles.
    """
    names = list(names)
    folders: dict[PurePosixPath, list[str]] = {}
    for name in names:
        if name.endswith(WEIGHTS):
            folders.setdefault(PurePosixPath(name).parent, []).append(name)
    picked = [name for name in names if name.endswith(SETTINGS) and not name.startswith(".cache/")]
    for files in folders.values():
        picked += next(
            group
            for end in (".fp16.safetensors", ".safetensors", ".fp16.bin", *WEIGHTS)
            if (group := [name for name in files if name.endswith(end)])
        )
    return picked


class _Fetched:
    """Counts fetched bytes, and tells `progress` (file, megabytes done, megabytes in all)."""

    def __init__(self, progress: Callable[[str, int, int], None] | None):
        self.progress, self.bytes = progress, 0

    def bar(self, name: str) -> Any:
        """A progress bar, as huggingface_hub makes one for each file, which draws nothing."""
        from tqdm import tqdm

        outer = self

        class Bar(tqdm):
            def __init__(self, *args: Any, **kwargs: Any):
                self.done, self.size = kwargs.get("initial") or 0, kwargs.get("total") or 0
                super().__init__(*args, **{**kwargs, "disable": True})

            def update(self, n: float | None = 1) -> bool | None:
                self.done += int(n or 0)
                outer.bytes += int(n or 0)
                if outer.progress:
                    outer.progress(name, self.done >> 20, max(1, self.size >> 20))
                return None

        return Bar


@contextmanager
def _hub_errors(model: HubModel) -> Iterator[None]:
    """Errors of the hub and of the disk as WeightsError and OutputError, with the way out."""
    from huggingface_hub.errors import HfHubHTTPError

    folder, page = folder_of(model), f"{endpoint()}/{model.repo}"
    try:
        yield
    except (WeightsError, KeyboardInterrupt):
        raise
    except Exception as error:  # several HTTP libraries raise their own
        if isinstance(error, HfHubHTTPError) and error.response is not None:
            code = error.response.status_code
            why = "there is no such public model" if code in (401, 403, 404) else "try again later"
            raise WeightsError(f"{page} answers {code}: {why}; or {INSTEAD}.") from error
        if isinstance(error, OSError) and error.errno is not None and not isinstance(error, ConnectionError):
            raise OutputError(
                f"{folder} cannot be written ({error.strerror or error}); free space, or set MATERIALIST_MODELS."
            ) from error
        reason = (str(error).strip().splitlines() or [type(error).__name__])[0][:200]
        raise WeightsError(
            f"{page} cannot be fetched ({reason}); run the same command again, or fetch "
            f"{model.main_file or 'its files'} elsewhere into a folder and take them from there: materialist models "
            f"download {model.name} --from FOLDER; or {INSTEAD}."
        ) from error


def _is_weights_name(name: str) -> bool:
    return name.endswith(WEIGHTS)
