"""The procedural data set on disk: whole samples only, made by one process or several, resumable."""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from materialist import __version__
from materialist.errors import InputError, OutputError
from materialist.io.atomic import write_whole
from materialist.render.variant import setup
from materialist.types import Progress
from materialist_lab.data.samples import SampleFolder, claim_folder, described, make_missing
from materialist_lab.data.sheets import strip, write_sheet
from materialist_lab.procedural.catalog.cache import CREDITS, listing
from materialist_lab.procedural.objects import shapes
from materialist_lab.procedural.options import DataSetOptions
from materialist_lab.procedural.sample import make_sample

FORMAT = 1
CONTENT = 13
"""Counts the changes of what sample i of a set holds."""
DESCRIPTION = "dataset.json"
_IDENTITY = ("format", "size", "seed", "split", "options", "content")
"""What decides what the samples of a set hold."""


def produce(
    folder: str | Path,
    options: DataSetOptions,
    *,
    count: int,
    workers: int = 1,
    resume: bool = False,
    progress: Progress = lambda *_: None,
) -> int:
    """Render the samples 0 .. count - 1 that `folder` lacks; sample i depends on the options and i alone.

    Raises InputError for bad numbers, a mesh that is damaged, a folder that holds something and no `resume`, or one
    begun with other options; OutputError when the folder cannot be written. Returns how many were rendered.
    """
    folder = Path(folder)
    if count < 1 or workers < 1:
        raise InputError(f"count is {count} and workers is {workers}; give at least 1 of each.")
    if options.mesh_files:
        setup(options.device)
    for path in options.mesh_files:  # a damaged one must not end a long run
        shapes.load(path)
    # The catalogue is read here, not by every worker.
    made_of = listing(options.archives, options.photographs, options.cache, progress)
    if not resume and folder.is_dir() and any(folder.iterdir()):
        raise InputError(
            f"{folder} exists and is not empty; add --resume to go on with it, or name another folder."
        )
    # A set is gone on with only where it was begun with the same options.
    claim_folder(folder, DESCRIPTION, _description(options), _IDENTITY)
    write_whole(folder / CREDITS, (made_of.folder / CREDITS).read_bytes())
    paths = [sample_path(folder, k) for k in range(count)]
    return make_missing(paths, partial(make_sample, options=options), "samples", progress, workers)


def sample_path(folder: Path, index: int) -> Path:
    """Where sample `index` lies."""
    return folder / "samples" / f"{index:07d}.npz"


def _description(options: DataSetOptions) -> dict[str, Any]:
    files = {"meshes": options.mesh_files, "envmaps": options.envmap_files}
    # Names, not paths: a set is the same on another machine.
    drawn: dict[str, Any] = {"spp": options.spp} | {
        name: [p.stem for p in paths] for name, paths in files.items()
    }
    real = (*options.archives, *options.photographs)
    drawn["real"] = [f"{p.name} {p.stat().st_size}" for p in real]
    facts = {
        "format": FORMAT,
        "size": options.size,
        "seed": options.seed,
        "split": options.split,
        "content": CONTENT,
    }
    return facts | {
        "options": drawn | ({"only": options.only} if options.only else {}),
        "tool_version": __version__,
    }


def identity(folder: str | Path) -> dict[str, Any]:
    """What tells the samples of one set from those of another, whatever their number and place.

    Raises InputError where DIR/dataset.json is none that this version can read.
    """
    file = Path(folder) / DESCRIPTION
    facts = described(file)
    if facts is None or facts.get("format") != FORMAT:
        raise InputError(
            f"{file} describes no data set of format {FORMAT}; make one: materialist train data."
        )
    return {name: facts.get(name) for name in _IDENTITY}


def write_data_sheet(
    folder: str | Path, path: str | Path, *, count: int = 24, seed: int = 0
) -> int:
    """Draw `count` samples of the set in `folder`, chosen by `seed`, as a PNG; returns how many.

    Each row shows picture, albedo, roughness, metallic, normal and depth. Raises InputError where there are no samples,
    OutputError when `path` cannot be written.
    """
    path = Path(path)
    if path.suffix.lower() != ".png" or not path.parent.is_dir():
        raise OutputError(f"{path} cannot be written; name a .png in a folder that exists.")
    source = SampleFolder(folder)
    chosen = sorted(np.random.default_rng(seed).permutation(len(source))[:count])
    samples = [source.read(k) for k in chosen]
    write_sheet([strip(sample.image, sample.truth()) for sample in samples], path)
    return len(chosen)
