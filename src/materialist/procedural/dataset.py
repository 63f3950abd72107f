"""A data set on disk: whole samples only, made by one process or several, to be gone on with after a stop."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from materialist.errors import InputError, OutputError
from materialist.procedural import heldout
from materialist.procedural.objects import things
from materialist.procedural.sample import KINDS, Options, make_sample

FORMAT = 1
CONTENT = {"train": 3, "heldout": 2}
"""Counts the changes of what sample i of a set of each split holds."""
_IDENTITY = ("size", "seed", "split", "options", "content")
"""What of a set's description decides what its samples hold."""
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Made:
    """What a call of `produce` did."""

    rendered: int
    existing: int
    seconds: float


def options_for(
    *, size: int = 256, seed: int = 0, spp: int = 16, split: str = "train", meshes: Path | None = None,
    envmaps: Path | None = None, device: str = "auto", only: str = "",
) -> Options:  # fmt: skip
    """Checked options with the files of the split. Raises InputError for values or folders that cannot be used."""
    if not 32 <= size <= 2048 or size % 4:
        raise InputError(f"The size is {size}; give 32 to 2048 pixels, a multiple of 4.")
    if not 1 <= spp <= 4096:
        raise InputError(f"spp is {spp}; give 1 to 4096 samples per pixel.")
    if seed < 0:
        raise InputError(f"The seed is {seed}; give 0 or more.")
    if only and only not in KINDS:
        raise InputError(f"There is no kind '{only}' of scene; give one of {', '.join(KINDS)}, or none for all.")
    mesh_files = heldout.files(meshes, ".ply", heldout.MESHES, split)
    maps = heldout.files(envmaps, ".exr", heldout.ENVMAPS, split)
    return Options(size, seed, spp, split, mesh_files, maps, device, only)


def produce(
    folder: str | Path, options: Options, *, count: int, workers: int = 1, resume: bool = False,
    progress: Progress | None = None,
) -> Made:  # fmt: skip
    """Render the samples 0 .. count - 1 that `folder` lacks.

    Sample i depends on the options and i alone. Each is written under a temporary name and then renamed.

    Raises:
        InputError: bad numbers, a mesh that is damaged, a folder that holds something and no `resume`, or one begun
            with other options.
        OutputError: the folder cannot be written.
    """
    folder = Path(folder)
    if count < 1 or workers < 1:
        raise InputError(f"count is {count} and workers is {workers}; give at least 1 of each.")
    for path in options.meshes:  # a damaged one must not end a long run
        things.mesh(path)
    _open(folder, options, resume)
    missing = [k for k in range(count) if not sample_path(folder, k).exists()]
    start, done = time.monotonic(), 0
    for done, _ in enumerate(_rendered(folder, options, missing, workers), 1):
        if progress is not None:
            progress("samples", count - len(missing) + done, count)
    return Made(done, count - len(missing), time.monotonic() - start)


def sample_path(folder: Path, index: int) -> Path:
    """Where sample `index` lies."""
    return folder / "samples" / f"{index:07d}.npz"


def _rendered(folder: Path, options: Options, missing: list[int], workers: int):
    if workers == 1 or len(missing) < 2:
        yield from (_write(folder, options, k) for k in missing)
        return
    import multiprocessing

    # Fresh processes: a renderer that has started does not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_one_thread) as pool:
        yield from pool.map(_write, [folder] * len(missing), [options] * len(missing), missing)


def _one_thread() -> None:
    """Workers share the processors by being several, not by each taking all."""
    os.environ["OMP_NUM_THREADS"] = "1"


def _write(folder: Path, options: Options, index: int) -> int:
    arrays = make_sample(index, options)
    path = sample_path(folder, index)
    temporary = path.with_suffix(f".{os.getpid()}.tmp")
    try:
        with open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error
    return index


def _open(folder: Path, options: Options, resume: bool) -> None:
    """Create the folder and its description, or check that it is the same set."""
    described = _description(options)
    file = folder / "dataset.json"
    if folder.is_dir() and any(folder.iterdir()):
        if not resume:
            raise InputError(
                f"{folder} exists and is not empty; add --resume to go on with it, or name another folder."
            )
        if file.exists():
            _same(read_description(folder), described, folder)
    try:
        (folder / "samples").mkdir(parents=True, exist_ok=True)
        for stale in (folder / "samples").glob("*.tmp"):
            stale.unlink(missing_ok=True)
        temporary = folder / f"dataset.{os.getpid()}.tmp"
        temporary.write_text(json.dumps(described, indent=1) + "\n", "utf-8")
        os.replace(temporary, file)
    except OSError as error:
        raise OutputError(f"{folder} cannot be written: {error.strerror or error}.") from error


def _description(options: Options) -> dict:
    from materialist import __version__

    return {
        "format": FORMAT, "size": options.size, "seed": options.seed, "split": options.split,
        "content": CONTENT[options.split],
        "options": {"spp": options.spp, "meshes": [p.stem for p in options.meshes],
                    "envmaps": [p.stem for p in options.envmaps]} | ({"only": options.only} if options.only else {}),
        "tool_version": __version__,
    }  # fmt: skip


def read_description(folder: str | Path) -> dict:
    """The content of DIR/dataset.json. Raises InputError where there is none that this version can read."""
    file = Path(folder) / "dataset.json"
    try:
        found = json.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{file} describes no data set ({error}); make one: materialist train data.") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise InputError(f"{file} has another format than {FORMAT}; make the set again with this version.")
    return found


def identity(folder: str | Path) -> dict:
    """What tells the samples of one set from those of another, whatever their number and place; see `_description`.

    Raises InputError as `read_description` does.
    """
    found = {"content": 1, **read_description(folder)}
    return {name: found.get(name) for name in _IDENTITY}


def _same(old: dict, new: dict, folder: Path) -> None:
    old = {"content": 1, **old}
    for name in _IDENTITY:
        if old.get(name) != new[name]:
            remedy = "resume with that or name another" if name != "content" else "name another, samples have changed"
            raise InputError(f"{folder} was begun with {name} {old.get(name)}, not {new[name]}; {remedy}.")
