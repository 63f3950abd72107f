"""Labelled pictures to train on: what one is, and folders of procedural ones, which say what decided their content."""

from __future__ import annotations

import json
import multiprocessing
import os
import threading
import zipfile
import zlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np

from materialist.camera import pixel_rays
from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.atomic import whole_file, write_whole, writing
from materialist.types import Array, Camera, Materials, Prediction, Progress

LIGHT_ROWS = 16
"""Rows of the map of the light around a sample."""


@dataclass(frozen=True)
class Sample:
    """One picture and its true maps, in the conventions of the project."""

    image: Array
    """[H, W, 3] float32 linear radiance, exposed, not clipped."""
    albedo: Array
    """[H, W, 3] float32 linear, in [0, 1]."""
    roughness: Array
    """[H, W] float32, in [0, 1]."""
    metallic: Array
    """[H, W] float32, in [0, 1]."""
    normal: Array
    """[H, W, 3] float32 unit, camera frame; zero where there is no surface."""
    depth: Array
    """[H, W] float32 planar, > 0, scene units; 0 where there is no surface."""
    mask: Array
    """[H, W] float32: 1 where the maps hold."""
    rays: Array
    """[H, W, 2] float32 x and y of the camera rays at z = -1: what a crop keeps of its camera."""
    shading: Array | None = None
    """[H, W, 3] float32 with image = albedo (1 - metallic) shading + rest; None where it is not known."""
    light: Array | None = None
    """[h, 2h, 4] float32 mean radiance that reaches the visible surfaces from what is not visible, equirectangular,
    camera frame, in the units of `image`; last the share of the surfaces that each direction reaches."""

    def truth(self) -> Prediction:
        return Prediction(
            Materials(self.albedo, self.roughness, self.metallic), self.normal, self.depth, "truth"
        )


class Source(ABC):
    """A set of samples."""

    paths: Sequence[Path]
    """The file of each sample, or its picture's."""
    notes: tuple[str, ...] = ()
    """What of the set is not there, in words."""

    def __len__(self) -> int:
        return len(self.paths)

    @abstractmethod
    def read(self, index: int) -> Sample:
        """Sample number `index`."""

    def refresh(self) -> None:  # noqa: B027 - most sets stay as they are
        """Look again: a set may grow while it is used."""

    def number(self, index: int) -> int:
        """What sample number `index` is called; it keeps that number when others come or go."""
        return index

    def seed(self) -> list[int | None] | None:
        """The seeds that the set was made with, where there are any."""
        return None

    def validation(self) -> Source | None:
        """The set that scores are taken on while this one is trained on, where it has one."""
        return None


class SampleFolder(Source):
    """Sets of `materialist train data` as one: DIR/dataset.json and DIR/samples/NNNNNNN.npz of each folder DIR.

    Samples lie in the order of the folders and of their names. Raises InputError where there are none.
    """

    def __init__(self, *folders: str | Path):
        self.folders = [Path(folder) for folder in folders]
        self.refresh()

    def read(self, index: int) -> Sample:
        return read_sample(self.paths[index])

    def number(self, index: int) -> int:
        """The number in the name of sample number `index`, which is that in its own set."""
        return int(self.paths[index].stem)

    def refresh(self) -> None:
        files = [sorted((folder / "samples").glob("[0-9]*.npz")) for folder in self.folders]
        for folder, paths in zip(self.folders, files, strict=True):
            if not paths:
                raise InputError(
                    f"{folder} holds no samples yet; make some with: materialist train data."
                )
        self.paths = list(chain.from_iterable(files))

    def seed(self) -> list[int | None]:
        """The seeds that the sets were made with; None where dataset.json does not tell."""
        contents = [described(folder / "dataset.json") or {} for folder in self.folders]
        return [content.get("seed", content.get("options", {}).get("seed")) for content in contents]


def read_sample(path: Path) -> Sample:
    """The sample in an .npz file; raises InputError naming the file when it is damaged or lacks an array."""
    arrays = read_arrays(
        path, "image", "albedo", "roughness", "metallic", "normal", "depth", "mask", "fov"
    )

    def as_light(values):
        return np.nan_to_num(values.astype(np.float32), posinf=6e4)

    try:
        # --- Stored as float16 and bytes: back to float32, and unit normals ---
        surface = (arrays["mask"] > 0) & (arrays["depth"] > 0)
        height, width = arrays["image"].shape[:2]
        normal = arrays["normal"].astype(np.float32)
        length = np.sqrt(np.einsum("hwc,hwc->hw", normal, normal))[..., None]
        return Sample(
            image=as_light(arrays["image"]),
            albedo=srgb_to_linear(arrays["albedo"]),
            roughness=arrays["roughness"].astype(np.float32) / 255,
            metallic=arrays["metallic"].astype(np.float32) / 255,
            normal=normal * (surface[..., None] / np.maximum(length, 1)).astype(np.float32),
            depth=np.where(surface, arrays["depth"].astype(np.float32), 0),
            mask=surface.astype(np.float32),
            rays=pixel_rays(Camera(width, height, float(arrays["fov"])))[..., :2].copy(),
            **{name: as_light(arrays[name]) for name in ("shading", "light") if name in arrays},
        )
    except (IndexError, ValueError) as error:
        raise InputError(
            f"The arrays of {path} do not fit together ({error}); make it again."
        ) from error


def read_arrays(path: Path, *needed: str) -> dict[str, Array]:
    """The arrays of an .npz; raises InputError naming the file when it is damaged or lacks one of the needed."""
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = dict(stored)
    except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(
            f"{path} cannot be read ({error}); delete it and make it again."
        ) from error
    for name in needed:
        if name not in arrays:
            raise InputError(f"{path} has no array {name!r}; delete it and make it again.")
    return arrays


def make_missing(
    paths: Sequence[Path],
    make: Callable[[int], dict[str, Array]],
    stage: str,
    progress: Progress,
    workers: int = 1,
) -> int:
    """Write those of the files of a folder that are missing, each whole or not at all; returns how many.

    `make` gives the arrays of number k; several processes make them where there are more `workers`.
    """
    folder = paths[0].parent
    folder.mkdir(exist_ok=True)
    for stale in folder.glob(".*.partial-*"):
        stale.unlink(missing_ok=True)
    # Files that are there stay: an interrupted run goes on where it stopped.
    missing = [k for k, path in enumerate(paths) if not path.exists()]
    # Fresh processes: a renderer that has started does not survive a fork.
    spawn = multiprocessing.get_context("spawn")
    with (
        ProcessPoolExecutor(workers, spawn, _start_worker) if workers > 1 else nullcontext() as pool
    ):
        written = (pool.map if pool else map)(
            _write, [paths[k] for k in missing], repeat(make), missing
        )
        for done, _ in enumerate(written, len(paths) - len(missing) + 1):
            progress(stage, done, len(paths))
    return len(missing)


def _start_worker() -> None:
    """Use one thread for renderers, and end with the process that started this one."""
    # Several workers with all threads each would slow each other down.
    os.environ["OMP_NUM_THREADS"] = "1"
    end_with_parent()


def end_with_parent() -> None:
    """Let this process of a pool end as soon as its parent has ended, however that happened.

    The pool cannot do it: a parent that gets SIGTERM or SIGKILL runs none of its code.
    """
    parent = multiprocessing.parent_process()
    # A thread that waits for the parent costs nothing.
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent,), daemon=True).start()


def _exit_after(parent: Any) -> None:
    parent.join()
    os._exit(3)


def _write(path: Path, make: Callable[[int], dict[str, Array]], number: int) -> None:
    """The arrays of that number as an .npz, whole or not at all. Raises OutputError where it cannot be written."""
    with whole_file(path, force=True) as temporary, open(temporary, "wb") as file:
        np.savez(file, **make(number))  # type: ignore[arg-type]


def claim_folder(folder: Path, name: str, description: dict[str, Any], keys: Sequence[str]) -> None:
    """Make FOLDER, and write the description of its set to FOLDER/name, or raise OutputError.

    Raises InputError when FOLDER holds a set whose description differs in one of `keys`, or other things.
    """
    with writing(folder):
        if folder.is_dir() and any(folder.iterdir()):
            old = described(folder / name)
            if old is None:
                raise InputError(
                    f"{folder} holds other things than such a set; name another folder."
                )
            # --- A set that was begun: only with the same options can it go on ---
            for key in keys:
                if old.get(key) != description[key]:
                    raise InputError(
                        f"{folder} was begun with {key} {old.get(key)}, not {description[key]}; go on with that or "
                        "name another folder."
                    )
        write_whole(folder / name, json.dumps(description, indent=1) + "\n")


def described(file: Path) -> dict[str, Any] | None:
    """The description in a file; None where there is none, or a damaged one."""
    try:
        content = json.loads(file.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return content if isinstance(content, dict) else None
