"""Stand-ins for the inversion, as workers load them by name; and photos to give them."""

import errno
import os
import signal
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from made_pipeline import scene_of
from made_scene import make_mesh
from PIL import Image

from materialist.batches.outcome import Outcome
from materialist.errors import InputError, OutputError, SetupError
from materialist.types import Geometry, Photo, Scene


def made_up(photo: Photo, **options) -> Scene:
    """A scene that depends on the photo, the seed and nothing else."""
    options["progress"]("read", 0, 1)
    scene = scene_of(photo)
    albedo = np.clip(photo.linear * np.float32(0.5 + 0.1 * options["seed"]), 0, 1).astype(
        np.float32
    )
    options["progress"]("light", 1, 1)
    return replace(scene, materials=replace(scene.materials, albedo=albedo))


def even(photo: Photo, **options) -> Scene:
    """The same before a flat wall that faces the camera, on which things can come to rest."""
    scene = made_up(photo, **options)
    depth = np.full_like(scene.depth, 3)
    normal = np.zeros_like(scene.normal)
    normal[..., 2] = 1
    geometry = Geometry(
        make_mesh(depth, normal, scene.camera), np.full_like(scene.geometry.plane_label, -1)
    )
    return replace(scene, depth=depth, normal=normal, geometry=geometry)


def moody(photo: Photo, **options) -> Scene:
    """What the photo's name says: bug, lacking, slow, or deadly (kills its worker; `deadly-once` only one)."""
    name = Path(photo.path or "").stem
    options["progress"]("read", 0, 1)
    if "bug" in name:
        raise RuntimeError("three is not four")
    if "impossible" in name:
        raise InputError("There is no surface in it.")
    if "lacking" in name:
        options["progress"]("predict", 0, 1)
        raise SetupError("No LLVM found; install one.")
    if "full" in name:
        raise OutputError(f"a.scene cannot be written: {os.strerror(errno.ENOSPC).lower()}.")
    if "slow" in name:
        options["progress"]("light", 0, 9)
        time.sleep(float(os.environ.get("MADE_SLOW", "0.4")))
    if "deadly" in name and _again(name):
        os.kill(os.getpid(), signal.SIGKILL)
    return made_up(photo, **options)


def run(source: Path, runs: Path, **options) -> Outcome:
    """A batch with `moody` for the inversion."""
    from materialist.batches.run import batch  # not at the top: workers load this file, too

    return batch(
        source, runs, **{"function": "made_batch:moody", "workers": 2, "device": "cpu", **options}
    )


def _again(name: str) -> bool:
    """Whether it should die: always, or only while its mark is missing."""
    mark = Path(os.environ["MADE_MARKS"]) / name
    fresh = not mark.exists()
    mark.touch()
    return fresh or "once" not in name


def photos(folder: Path, *names: str) -> Path:
    """Small photos, each its own."""
    for k, name in enumerate(names):
        file = folder / (name if Path(name).suffix.lower() in (".png", ".jpg") else f"{name}.png")
        file.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.random.default_rng(k).integers(0, 256, (16, 24, 3)).astype(np.uint8)
        Image.fromarray(pixels).save(file)
    return folder
