"""Data sets in folders: procedural samples, and InteriorVerse (Zhu et al. 2022), which the paper's network learnt from.

InteriorVerse in its published layout:

    FOLDER/                       dataset_85 or dataset_120: the number is the horizontal field of view in degrees
        train.txt val.txt test.txt    names of scenes, one a line
        SCENE/NNN_im.exr              linear HDR radiance
        SCENE/NNN_albedo.exr          linear, in [0, 1]
        SCENE/NNN_material.exr        R roughness, G metallic
        SCENE/NNN_depth.exr           planar, millimetres, inf where there is nothing
        SCENE/NNN_normal.exr          camera frame, +X right, +Y up, +Z to the viewer: ours
        SCENE/NNN_mask.exr            1 where the maps hold

Copies named scenes_85 and scenes_120 are the same. The published splits lost meaning in 2026, when part of the data was
lost: scenes that a list names and the folder lacks are passed over, and told in `notes`.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import numpy as np

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.io.exr import read_exr
from materialist.types import Array, Camera
from materialist_lab.data.samples import Sample, SampleFolder, Source

SPLITS = ("train", "val", "test")
PARTS = ("dataset_85", "dataset_120", "scenes_85", "scenes_120")
MILLIMETRES = 1e-3
"""Metres in a millimetre: depth is given in metres, as the paper's limit of 20 asks."""
WHITE = 0.9
"""Where the 97th percentile of a picture's brightest channel is put: the renderings have no exposure of their own."""
MAPS = ("im", "albedo", "material", "depth", "normal")


def open_sources(folders: Sequence[Path], *, split: str = "train") -> Source:
    """The data set in folders: a split of InteriorVerse in one, or the procedural sets of one or several.

    Raises InputError for a folder that is missing, is neither or is empty, and for an InteriorVerse among several.
    """
    for folder in folders:
        if not folder.is_dir():
            raise InputError(
                f"There is no data folder {folder}; make one with: materialist train data -o {folder}."
            )
        if (folder / "samples").is_dir():
            continue
        if not parts(folder):
            raise InputError(
                f"{folder} holds neither 'samples' (materialist train data) nor InteriorVerse scenes; check the path."
            )
        if len(folders) > 1:
            raise InputError(
                f"{folder} is InteriorVerse; only sets of materialist train data can be put together."
            )
        return InteriorVerse(folder, split)
    return SampleFolder(*folders)


class InteriorVerse(Source):
    """One split of one or both parts of the data set."""

    def __init__(self, folder: str | Path, split: str = "train"):
        """Open FOLDER, or its dataset_85 and dataset_120. Raises InputError for an unknown split or another layout."""
        if split not in SPLITS:
            raise InputError(
                f"InteriorVerse has no split '{split}'; choose one of {', '.join(SPLITS)}."
            )
        self.folder = Path(folder)
        self.split = split
        scenes = {}
        # Scenes by part: both parts may have one of the same name.
        for part in parts(self.folder):
            listed = part / f"{split}.txt"
            for scene in listed.read_text("utf-8").split() if listed.is_file() else ():
                scenes[f"{part.name}/{scene}"] = sorted((part / scene).glob("*_im.exr"))
        pictures = list(chain.from_iterable(scenes.values()))
        self.paths = [
            path for path in pictures if all(_sibling(path, name).is_file() for name in MAPS)
        ]
        if not self.paths:
            raise InputError(
                f"{self.folder} holds no pictures of the InteriorVerse split '{split}'; check the path."
            )
        # --- Notes on scenes and maps that are lost ---
        lost = [name for name, paths in scenes.items() if not paths]
        bare = len(pictures) - len(self.paths)
        if lost:
            names = ", ".join(lost[:3])
            self.notes += (
                f"{len(lost)} scenes of the split '{split}' are not there ({names} ...).",
            )
        if bare:
            self.notes += (f"{bare} pictures of the split '{split}' lack a map, and are left out.",)

    def validation(self) -> InteriorVerse | None:
        """The split that scores are taken on while this one is trained on; None where it holds no pictures."""
        try:
            return InteriorVerse(self.folder, "val") if self.split == "train" else None
        except InputError:
            return None

    def read(self, index: int) -> Sample:
        """Picture number `index`; depth in metres. Raises InputError naming a file that is missing or misshapen."""
        path = self.paths[index]
        maps = {
            name: _map(path, name)
            for name in (*MAPS, "mask")
            if name in MAPS or _sibling(path, name).is_file()
        }
        height, width = maps["im"].shape[:2]
        for name, values in maps.items():
            if values.shape[:2] != (height, width):
                raise InputError(
                    f"{_sibling(path, name)} is {values.shape[:2]}, but its picture is {(height, width)}."
                )
        return _sample(maps, Camera(width, height, field_of_view(path)))


def parts(folder: Path) -> list[Path]:
    """The folder itself and its parts, where they have lists of scenes."""
    folders = [folder, *(folder / part for part in PARTS)]
    return [
        place for place in folders if any((place / f"{split}.txt").is_file() for split in SPLITS)
    ]


def field_of_view(path: Path) -> float:
    """Horizontal field of view, degrees: the number in the name of the part that the picture lies in, else 85."""
    matches = (re.fullmatch(r"(?:dataset|scenes)_(\d+)", parent.name) for parent in path.parents)
    return next((float(match[1]) for match in matches if match), 85.0)


def _sample(maps: dict[str, Array], camera: Camera) -> Sample:
    """The maps in our conventions; a pixel counts when its mask, depth and normal say so."""
    # --- Surface: where depth, normal and mask all hold ---
    depth = maps["depth"][..., 0] * MILLIMETRES
    length = np.linalg.norm(maps["normal"][..., :3], axis=-1)
    surface = np.isfinite(depth) & (depth > 0) & np.isfinite(length) & (length > 0.5)
    if "mask" in maps:
        surface &= maps["mask"][..., 0] > 0.5
    normal = np.where(
        surface[..., None], maps["normal"][..., :3] / np.maximum(length, 1e-6)[..., None], 0
    )
    rays = pixel_rays(camera)
    # Sheets that are modelled without a back show some normals from behind.
    normal *= np.where((normal * rays).sum(-1, keepdims=True) > 0, -1, 1)
    # --- Exposure: the 97th percentile of the brightest channel goes to WHITE ---
    image = np.maximum(np.nan_to_num(maps["im"][..., :3], posinf=6e4), 0)
    bright = float(np.percentile(image.max(-1), 97))

    def unit(a):
        return np.clip(np.nan_to_num(a), 0, 1).astype(np.float32)

    exposed = (image * (WHITE / max(bright, 1e-6))).astype(np.float32)
    material = maps["material"]
    return Sample(
        exposed,
        unit(maps["albedo"][..., :3]),
        unit(material[..., 0]),
        unit(material[..., 1]),
        normal.astype(np.float32),
        np.where(surface, depth, 0).astype(np.float32),
        surface.astype(np.float32),
        rays[..., :2].copy(),
    )


def _map(path: Path, name: str) -> Array:
    """[H, W, C] float32 values of the picture's map; raises InputError when it is missing or lacks channels."""
    file = _sibling(path, name)
    values = np.atleast_3d(read_exr(file))
    needed = {"depth": 1, "mask": 1, "material": 2}.get(name, 3)
    if values.shape[2] < needed:
        raise InputError(f"{file} has {values.shape[2]} channels, but {needed} are needed.")
    return values


def _sibling(path: Path, name: str) -> Path:
    return path.with_name(path.name.removesuffix("_im.exr") + f"_{name}.exr")
