"""The files of a scene package, checked by their headers before anything is decoded."""

from pathlib import Path

import numpy as np

from materialist.errors import SceneError
from materialist.io.bitmap import stored_pixels
from materialist.io.decode import RAW_SUFFIXES, decoded_bytes, image_size
from materialist.io.exr import exr_bytes, exr_headers, exr_size, read_exr
from materialist.types import Array

MAX_SIDE = 8192
"""Pixels along the longer side of any map: the largest working size, environment map or texture there is."""
MAX_BYTES = 16e9
"""Bytes of a whole package once decoded; the largest that this program writes has half as many."""
RAW_BYTES_RATIO = 12
"""Bytes of a decoded camera RAW for one of its file."""
MAPS = ("albedo", "roughness", "metallic", "normal", "depth")
LIGHT = "prior/light.exr"
"""The light of a predictor that knows any: radiance, and its scale as alpha."""


def spread_file(name: str) -> str:
    """Where the package has the expected error of a map of the prior, if its predictor knew one."""
    return f"prior/{name}_spread.exr"


def check_files(folder: Path, original: str, bodies: int, most: float) -> None:
    """Raise SceneError unless the files are there, lie in the folder, and decode to at most `most` bytes.

    Raises whatever the readers of their headers raise.
    """
    # --- The files that this package must have, and those that it may ---
    pictures = [f"{part}/{name}.exr" for part in ("prior", "maps") for name in MAPS]
    pictures += [file for file in map(spread_file, MAPS) if (folder / file).exists()]
    pictures += ["photo.exr", "rerender.exr", "envmap.exr"]
    if (folder / LIGHT).exists():
        pictures.append(LIGHT)
    pictures += [f"bodies/{k}.{name}.exr" for k in range(bodies) for name in MAPS[:3]]
    meshes = ["mesh.ply", *(f"bodies/{k}.ply" for k in range(bodies))]
    # --- Their size in memory, by headers alone ---
    total = sum(_exr_bytes(inside(folder, name)) for name in pictures)
    total += sum(inside(folder, name).stat().st_size for name in meshes)
    _check_size(label := inside(folder, "plane_label.png"), image_size(label))
    total += photo_bytes(inside(folder, original)) + decoded_bytes(label)
    if total > most:
        raise SceneError(
            f"The scene {folder} takes {total / 1e9:.1f} GB of memory, more than {most / 1e9:g} GB; "
            "invert its photo again at a smaller working size."
        )


def package_map(path: Path, shape: tuple[int, ...] | None = None) -> Array:
    """A map of a known shape, or of any. Raises SceneError for another one, and for NaN, InputError for none."""
    array = read_exr(path) if path.suffix == ".exr" else stored_pixels(path)[0][..., 0]
    if shape is not None and array.shape != shape:
        raise SceneError(
            f"{path} is {list(array.shape)}, the scene needs {list(shape)}; the package is damaged."
        )
    if not np.isfinite(array).all():
        raise SceneError(f"{path} has values that are NaN or infinite; the package is damaged.")
    return array


def _exr_bytes(file: Path) -> int:
    """Bytes of all channels once decoded."""
    _check_size(file, exr_size(exr_headers(file)[0]))
    return exr_bytes(file)


def photo_bytes(file: Path) -> int:
    """Bytes of a photo once decoded."""
    return (
        RAW_BYTES_RATIO * file.stat().st_size
        if file.suffix.lower() in RAW_SUFFIXES
        else decoded_bytes(file)
    )


def _check_size(file: Path, size: tuple[int, int]) -> None:
    # The photo as it was given may be larger; its own limit applies when it is read.
    if not 1 <= min(size) <= max(size) <= MAX_SIDE and file.stem != "original":
        raise SceneError(
            f"{file} is {size[0]} x {size[1]} pixels; {MAX_SIDE} on a side is the limit."
        )


def inside(folder: Path, name: str) -> Path:
    """A file of the package. Raises SceneError where it is missing, or a link leads out of the folder."""
    file = folder / name
    # A link in a package from somebody else could lead anywhere.
    if not file.resolve().is_relative_to(folder.resolve()):
        raise SceneError(
            f"{file} leads out of the scene package, which is never followed; copy the file there."
        )
    if not file.is_file():
        raise SceneError(f"{file} is missing; this is not a whole scene package.")
    return file
