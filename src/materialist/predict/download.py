"""Fetch a model from a hub, file by file, with its checksums. Only `materialist models download` calls this."""

from __future__ import annotations

import http.client
import json
import os
import shutil
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from materialist.errors import InputError, OutputError, WeightsError
from materialist.predict.models import CHECKSUMS, INSTEAD, HubModel, folder_of
from materialist.predict.weights import read_checksums, sha256

TIMEOUT = 10.0
"""Seconds without an answer after which the hub counts as out of reach."""
CHUNK = 1 << 20
WEIGHTS = (".safetensors", ".pth", ".pt", ".bin", ".ckpt")
SETTINGS = (".json", ".txt", ".model")
"""Configurations and vocabularies: what a pipeline needs beside its weights."""


@dataclass(frozen=True)
class Remote:
    """A file on the hub."""

    name: str
    size: int
    """Bytes, 0 when the hub does not say."""
    sha256: str | None
    """What the hub says it must be; it does so for large files."""


def endpoint() -> str:
    """The hub: $HF_ENDPOINT, else huggingface.co."""
    return os.environ.get("HF_ENDPOINT", "https://huggingface.co").rstrip("/")


def download(
    model: HubModel, *, force: bool = False, progress: Callable[[str, int, int], None] | None = None
) -> tuple[Path, int]:
    """Fetch what the model needs into its folder; returns the folder and the bytes fetched now.

    Every file is compared with the hub's own sha256 where it gives one; the list of all checksums is written last.
    An interrupted download is taken up where it stopped; `force` fetches everything again. Raises WeightsError when
    the hub cannot be reached, has no such model, or sends something else than it promised; OutputError when the disk
    is full or read-only.
    """
    folder = folder_of(model)
    wanted = chosen(_listing(model))
    if not any(remote.name.endswith(WEIGHTS) for remote in wanted):
        raise WeightsError(f"{endpoint()}/{model.repo} holds no file of weights; check the id.")
    known = {} if force else read_checksums(folder)
    sums, fetched = {}, 0
    try:
        for remote in wanted:
            target = folder / remote.name
            target.parent.mkdir(parents=True, exist_ok=True)
            if known.get(remote.name) and target.is_file() and sha256(target) == (remote.sha256 or known[remote.name]):
                sums[remote.name] = known[remote.name]
                continue
            sums[remote.name] = _fetch(model, remote, target, progress, fresh=force)
            fetched += target.stat().st_size
        (folder / CHECKSUMS).write_text("".join(f"{s}  {n}\n" for n, s in sorted(sums.items())), "utf-8")
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written ({error.strerror or error}); free space, or set MATERIALIST_MODELS."
        ) from error
    return folder, fetched


def adopt(model: HubModel, source: Path) -> tuple[Path, int]:
    """As `download`, of files that were fetched elsewhere into the folder `source`; the hub is not asked.

    Raises InputError where the folder lacks the model's files, OutputError when the disk is full or read-only.
    """
    if not source.is_dir():
        raise InputError(f"There is no folder {source}; give the one that holds the files of {model.repo}.")
    there = [path for path in sorted(source.rglob("*")) if path.is_file()]
    wanted = chosen([Remote(path.relative_to(source).as_posix(), path.stat().st_size, None) for path in there])
    names = {remote.name for remote in wanted}
    needed = {model.main_file} - {""} if not model.main_file.endswith(WEIGHTS) else set()
    if not any(name.endswith(WEIGHTS) for name in names) or not needed <= names:
        raise InputError(f"{source} lacks {model.main_file or 'a file of weights'} of {model.repo}; fetch it again.")
    folder, sums = folder_of(model), {}
    try:
        for remote in wanted:
            target = folder / remote.name
            target.parent.mkdir(parents=True, exist_ok=True)
            if not (target.is_file() and target.samefile(source / remote.name)):
                partial = target.with_name(target.name + ".partial")
                shutil.copyfile(source / remote.name, partial)
                partial.replace(target)
            sums[remote.name] = sha256(target)
        (folder / CHECKSUMS).write_text("".join(f"{s}  {n}\n" for n, s in sorted(sums.items())), "utf-8")
    except OSError as error:
        raise OutputError(
            f"{folder} cannot be written ({error.strerror or error}); free space, or set MATERIALIST_MODELS."
        ) from error
    return folder, sum(remote.size for remote in wanted)


def chosen(listing: list[Remote]) -> list[Remote]:
    """What of a repository is needed: all settings, and of the weights of each folder the best of several formats.

    Half precision before full (it is the same network at half the size), safetensors before pickles.
    """
    picked = [remote for remote in listing if remote.name.endswith(SETTINGS)]
    folders: dict[PurePosixPath, list[Remote]] = {}
    for remote in listing:
        if remote.name.endswith(WEIGHTS):
            folders.setdefault(PurePosixPath(remote.name).parent, []).append(remote)
    for files in folders.values():
        picked += next(
            group
            for end in (".fp16.safetensors", ".safetensors", ".fp16.bin", *WEIGHTS)
            if (group := [remote for remote in files if remote.name.endswith(end)])
        )
    return picked


def _listing(model: HubModel) -> list[Remote]:
    """The files of the repository, with sizes and checksums."""
    with _open(model, f"{endpoint()}/api/models/{model.repo}?blobs=true") as answer:
        try:
            siblings = json.load(answer)["siblings"]
            found = [
                Remote(str(f["rfilename"]), int(f.get("size") or 0), (f.get("lfs") or {}).get("sha256"))
                for f in siblings
            ]
        except (ValueError, KeyError, TypeError, OSError, http.client.HTTPException) as error:
            raise WeightsError(f"{endpoint()} answers, but not like a model hub ({error}); see HF_ENDPOINT.") from error
    unsafe = [r.name for r in found if PurePosixPath(r.name).is_absolute() or ".." in PurePosixPath(r.name).parts]
    if unsafe:
        raise WeightsError(f"{model.repo} lists a file outside its own folder ({unsafe[0]}); it was not fetched.")
    return found


def _fetch(model: HubModel, remote: Remote, target: Path, progress, *, fresh: bool) -> str:
    """One file, through a `.partial` beside it that a later call takes up; returns its sha256."""
    partial = target.with_name(target.name + ".partial")
    have = partial.stat().st_size if partial.is_file() else 0
    if fresh or (remote.size and have > remote.size):
        partial.unlink(missing_ok=True)
        have = 0
    url = f"{endpoint()}/{model.repo}/resolve/main/{urllib.parse.quote(remote.name)}"
    try:
        if not (remote.size and have == remote.size):
            _stream(model, url, partial, have, remote, progress)
    except (TimeoutError, http.client.HTTPException, ConnectionError) as error:
        raise WeightsError(
            f"The download of {remote.name} broke off ({error or 'no answer'}); run the same command again to go on."
        ) from error
    digest = sha256(partial)
    if (remote.sha256 and digest != remote.sha256) or (remote.size and partial.stat().st_size != remote.size):
        partial.unlink()
        raise WeightsError(
            f"{remote.name} came damaged from {url}: sha256 {digest}, expected {remote.sha256 or 'another size'}; "
            "run the same command again."
        )
    partial.replace(target)
    return digest


def _stream(model: HubModel, url: str, partial: Path, have: int, remote: Remote, progress) -> None:
    """Append the rest of `url` to the partial file, or start it again where the hub cannot send a rest."""
    with _open(model, url, {"Range": f"bytes={have}-"} if have else {}) as answer:
        resumed = answer.status == 206
        done = have if resumed else 0
        total = remote.size or done + int(answer.headers.get("Content-Length") or 0)
        with partial.open("ab" if resumed else "wb") as file:
            while chunk := answer.read(CHUNK):
                file.write(chunk)
                done += len(chunk)
                if progress:
                    progress(remote.name, done >> 20, max(1, total >> 20))
        if done < total:
            raise ConnectionError(f"after {done} of {total} bytes")


def _open(model: HubModel, url: str, headers: dict[str, str] | None = None):
    """An open HTTP answer. Raises WeightsError that says what to do without the hub."""
    request = urllib.request.Request(url, headers={"User-Agent": "materialist", **(headers or {})})
    try:
        return urllib.request.urlopen(request, timeout=TIMEOUT)
    except urllib.error.HTTPError as error:
        why = "there is no such public model" if error.code in (401, 403, 404) else "try again later"
        raise WeightsError(f"{url} answers {error.code} {error.reason}: {why}; or {INSTEAD}.") from error
    except (urllib.error.URLError, TimeoutError, OSError, http.client.HTTPException, ValueError) as error:
        reason = getattr(error, "reason", error)
        by_hand = f"fetch {model.main_file or 'the files'} elsewhere from {endpoint()}/{model.repo}"
        raise WeightsError(
            f"{endpoint()} cannot be reached ({reason}); {by_hand} and give the file with --predictor matnet:FILE, "
            f"or {INSTEAD}."
            if model.name == "matnet"
            else f"{endpoint()} cannot be reached ({reason}); {by_hand} into a folder, and take them from there: "
            f"materialist models download {model.name} --from FOLDER; or {INSTEAD}."
        ) from error
