"""`moge:DIR`: what `moge infer --maps` (Wang et al. 2025) has written: depth, normals, mask and field of view."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.image import read_map as read_data
from materialist.predict import resample
from materialist.predict.maps import check_aspect, read_map
from materialist.predict.normals import normals_from_depth
from materialist.predict.protocol import Part
from materialist.types import Array, Photo

HOW = "write it with: moge infer -i PHOTO -o DIR --maps"


class MogeFolder:
    """Reads depth.exr, mask.png, normal.png and fov.json from a folder, or from the one folder in it that has them."""

    gives = ("normal", "depth")

    def __init__(self, folder: str | Path):
        if not str(folder):
            raise InputError(f"moge: needs a folder, as in --depth moge:DIR; {HOW}")
        self.folder = _result_folder(Path(folder).expanduser())
        self.field_of_view = _field_of_view(self.folder / "fov.json")

    @property
    def name(self) -> str:
        """'moge:DIR'."""
        return f"moge:{self.folder}"

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> Part:
        """Depth [H, W] in metres (as MoGe's second version says) and normals [H, W, 3]; `seed` changes nothing.

        Where the mask is empty, or depth infinite, there is no surface. Without a normal.png (first version) the
        normals are derived from depth. MoGe looks down +Z with +Y down, but encodes its normals the usual way:
        red to the right, green up, blue to the viewer, which is our frame.
        """
        size = photo.linear.shape[:2]
        depth = self._depth(size)
        maps, sources = {"depth": depth}, dict.fromkeys(self.gives, self.name)
        if "normal" in wanted:
            maps["normal"] = normals_from_depth(depth, photo.camera, radius=2)
            found = self._normal(size)
            if found is None:
                sources["normal"] = f"derived from the depth of {self.name}"
            else:
                known = np.linalg.norm(found, axis=-1, keepdims=True) > 0.5
                maps["normal"] = np.where(known & (depth > 0)[..., None], found, maps["normal"])
        return Part({k: maps[k] for k in wanted}, {k: sources[k] for k in wanted})

    def _depth(self, size: tuple[int, int]) -> Array:
        """[H, W] float32 at the photo's size, 0 where there is no surface."""
        path = self.folder / "depth.exr"
        depth = read_data(path)
        depth = depth[..., 0] if depth.ndim == 3 else depth
        check_aspect(depth, size, path)
        mask = self.folder / "mask.png"
        if mask.is_file():
            pixels = read_data(mask)
            if pixels.shape[:2] != depth.shape:
                raise InputError(f"{mask} is of another size than depth.exr; {HOW}")
            depth = np.where(pixels.reshape(*depth.shape, -1)[..., 0] > 0.5, depth, 0)
        depth = np.where(np.isfinite(depth) & (depth > 0), depth, 0).astype(np.float32)
        if not (depth > 0).any():
            raise InputError(f"{path} has no surface anywhere; {HOW}")
        return depth if depth.shape == size else resample.depth(depth, size)

    def _normal(self, size: tuple[int, int]) -> Array | None:
        """[H, W, 3] float32 unit at the photo's size, zero where unknown; None without a file."""
        path = self.folder / "normal.png"
        if not path.is_file():
            return None
        normal = read_map(path, "normal")
        check_aspect(normal, size, path)
        length = np.linalg.norm(normal, axis=-1, keepdims=True)
        normal = np.where(length > 0.5, normal / np.maximum(length, 0.5), 0).astype(np.float32)
        return normal if normal.shape[:2] == size else resample.normals(normal, size)


def _result_folder(folder: Path) -> Path:
    """The folder with depth.exr: this one, or the only one directly in it. Raises InputError."""
    if not folder.is_dir():
        raise InputError(f"There is no folder {folder} with MoGe's output; {HOW}")
    if (folder / "depth.exr").is_file():
        return folder
    inner = [path.parent for path in sorted(folder.glob("*/depth.exr"))]
    if len(inner) != 1:
        several = f"holds several results ({', '.join(p.name for p in inner[:3])}); name one of them" if inner else (
            f"holds no depth.exr; {HOW}"
        )  # fmt: skip
        raise InputError(f"{folder} {several}.")
    return inner[0]


def _field_of_view(path: Path) -> float | None:
    """Horizontal field of view in degrees; None without a file. Raises InputError when it cannot be meant."""
    if not path.is_file():
        return None
    try:
        angle = float(json.loads(path.read_text("utf-8"))["fov_x"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{path} does not say fov_x in degrees ({error}); {HOW}") from error
    if not 1 < angle < 170:
        raise InputError(f"{path} says a field of view of {angle:g} degrees; it must be between 1 and 170.")
    return angle
