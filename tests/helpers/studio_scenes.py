"""Small scenes for the studio: `edit_scenes` again, with a field of view and a warning, as packages on disk."""

import atexit
import shutil
import tempfile
import zipfile
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
from edit_scenes import scene_of

from materialist.io.package import save_scene
from materialist.types import Camera, FitReport, Scene

HEIGHT = 48
WIDTH = 64


def block() -> np.ndarray:
    """[H, W] bool of the red block."""
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[16:32, 16:34] = True
    return mask


@lru_cache(maxsize=1)
def room() -> Scene:
    """A red block before a grey wall; the top rows are sky."""
    depth = np.where(block(), 2.0, 3.0)
    depth[:4] = 0
    albedo = np.where(block()[..., None], [0.6, 0.12, 0.08], [0.5, 0.5, 0.45])
    normal = np.broadcast_to([0, 0, 1], albedo.shape)
    scene = scene_of(Camera(WIDTH, HEIGHT, 40.0), depth, normal, albedo, completion="none")
    photo = replace(scene.photo, fov_source="exif", path="room <b>.png")
    report = FitReport(metrics={"rerender_psnr_path": 31.5}, warnings=("It is too dark.",))
    return replace(scene, photo=photo, report=report)


def package(folder: Path) -> Path:
    """The room as a scene package."""
    return Path(shutil.copytree(_saved(), folder / "room.scene"))


@lru_cache(maxsize=1)
def _saved() -> Path:
    """The room's package, written once: its overview takes as long as all else of a small test."""
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    save_scene(room(), folder / "room.scene")
    return folder / "room.scene"


def zipped(file: Path, members: dict[str, str | bytes]) -> Path:
    """A zip file of these members."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        for name, content in members.items():
            made.writestr(name, content)
    return file


def zipped_package(folder: Path, root: str = "", **more: str) -> Path:
    """The room's package as a zip file, in a folder `root/` of it."""
    scene = package(folder)
    files = {
        f"{root}{file.relative_to(scene)}": file.read_bytes()
        for file in scene.rglob("*")
        if file.is_file()
    }
    return zipped(folder / "a.zip", files | more)


def click(session, x: float = 25, y: float = 24, mode: str = "new") -> None:
    """A click of the page at a working pixel; by default on the block."""
    session.pick("click", mode=mode, at=[x, y])
