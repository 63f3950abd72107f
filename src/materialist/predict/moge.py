"""`moge:DIR`: what `moge infer --maps` (Wang et al. 2025) has written: depth, normals, mask and field of view."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from materialist.errors import InputError
from materialist.io.image import read_map as read_data
from materialist.predict.maps import MapsPredictor
from materialist.types import Array

HOW = "write it with: moge infer -i PHOTO -o DIR --maps"


class MogeFolder(MapsPredictor):
    """Reads depth.exr, mask.png, normal.png and fov.json from a folder, or from the one folder in it that has them.

    Depth is in metres (in MoGe's second version), and no surface where the mask is empty or depth is infinite. MoGe
    looks down +Z with +Y down, but encodes its normals the usual way (red to the right, green up, blue to the viewer),
    which is our frame; its first version writes none.
    """

    gives = ("normal", "depth")

    def __init__(self, folder: str | Path):
        if not str(folder):
            raise InputError(f"moge: needs a folder, as in --depth moge:DIR; {HOW}")
        super().__init__(folder)
        found = [path.parent for path in sorted((*self.folder.glob("depth.exr"), *self.folder.glob("*/depth.exr")))]
        if self.folder not in found and len(found) != 1:
            names = ", ".join(path.name for path in found[:3])
            several = f"several results ({names}); name one of them" if found else f"no depth.exr; {HOW}"
            raise InputError(f"{self.folder} holds {several}.")
        self.folder = self.folder if self.folder in found else found[0]
        self.field_of_view = _field_of_view(self.folder / "fov.json")
        self.source = f"moge:{self.folder}"

    def read(self, name: str, path: Path, warnings: list[str]) -> Array:
        """The values of a map at their own size; depth is 0 where mask.png is."""
        values, mask = super().read(name, path, warnings), self.folder / "mask.png"
        if name != "depth" or not mask.is_file():
            return values
        pixels = read_data(mask)
        if pixels.shape[:2] != values.shape:
            raise InputError(f"{mask} is of another size than depth.exr; {HOW}")
        values = np.where(pixels.reshape(*values.shape, -1)[..., 0] > 0.5, values, 0)
        if not (values > 0).any():
            raise InputError(f"{path} has no surface anywhere; {HOW}")
        return values


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
