"""The files of a scene package, checked by their headers before anything is decoded."""

from __future__ import annotations

import math
from pathlib import Path

from materialist.errors import InputError, SceneError
from materialist.io.decode import RAW_SUFFIXES, image_size
from materialist.io.exr import exr_headers, exr_size
from materialist.types import Camera

LONGEST = 8192
"""Pixels along the longer side of any map: the largest working size, environment map or texture there is."""
MOST = 16e9
"""Bytes of a whole package once decoded; the largest that this program writes has half as many."""
RAW_GROWS = 12
"""Bytes of a decoded camera RAW for one of its file."""
MAPS = ("albedo", "roughness", "metallic", "normal", "depth")


def check_files(folder: Path, camera: Camera, original: str, bodies: int, most: float) -> None:
    """Check that the files are there, lie in the folder, have the camera's size, and decode to at most `most` bytes.

    Raises SceneError.
    """
    size = (camera.width, camera.height)
    sized = [f"{part}/{name}.exr" for part in ("prior", "maps") for name in MAPS] + ["photo.exr", "rerender.exr"]
    free = ["envmap.exr", *(f"bodies/{k}.{name}.exr" for k in range(bodies) for name in MAPS[:3])]
    meshes = ["mesh.ply", *(f"bodies/{k}.ply" for k in range(bodies))]
    try:
        total = sum(_exr_bytes(_inside(folder, name), size if name in sized else None) for name in (*sized, *free))
        total += sum(_inside(folder, name).stat().st_size for name in meshes)
        total += _photo_bytes(_inside(folder, original))
        _check_size(label := _inside(folder, "plane_label.png"), image_size(label), size)
    except SceneError:
        raise
    except Exception as error:  # readers of damaged files raise anything
        raise SceneError(f"The scene package {folder} is damaged: {error}") from error
    if total > most:
        raise SceneError(
            f"The scene {folder} takes {total / 1e9:.1f} GB of memory, more than {most / 1e9:g} GB; "
            "invert its photo again at a smaller --size."
        )


def _exr_bytes(file: Path, size: tuple[int, int] | None) -> int:
    """Bytes of all channels once decoded, of an EXR of a size, or of any up to the largest."""
    headers = exr_headers(file)
    if any("deep" in str(header.get("type")) for header in headers):
        raise InputError(f"{file} holds deep pixels; save it as a plain picture.")
    _check_size(file, exr_size(headers[0]), size)
    return 4 * sum(math.prod(exr_size(header)) * len(header["channels"]) for header in headers)


def _photo_bytes(file: Path) -> int:
    """Bytes of a photo once decoded."""
    if file.suffix.lower() in RAW_SUFFIXES:
        return RAW_GROWS * file.stat().st_size
    if file.suffix.lower() == ".exr":
        return _exr_bytes(file, None)
    return 12 * math.prod(image_size(file))


def _check_size(file: Path, found: tuple[int, int], size: tuple[int, int] | None) -> None:
    if size is not None and found != size:
        shown = [f"{width} x {height}" for width, height in (found, size)]
        raise SceneError(f"{file} is {shown[0]} pixels, the scene {shown[1]}; the package is damaged.")
    if not 1 <= min(found) <= max(found) <= LONGEST and file.stem != "original":
        raise SceneError(f"{file} is {found[0]} x {found[1]} pixels; {LONGEST} on a side is the limit.")


def _inside(folder: Path, name: str) -> Path:
    """A file of the package. Raises SceneError where it is missing, or a link leads out of the folder."""
    file = folder / name
    if not file.resolve().is_relative_to(folder.resolve()):
        raise SceneError(f"{file} leads out of the scene package, which is never followed; copy the file there.")
    if not file.is_file():
        raise SceneError(f"{file} is missing; this is not a whole scene package.")
    return file
