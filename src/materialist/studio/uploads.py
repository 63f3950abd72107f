"""Uploaded files: checked by size and header before anything is decoded, and stored under names of ours."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import InputError
from materialist.io.bitmap import check_size
from materialist.io.decode import RAW_SUFFIXES, SUFFIXES, decoded_bytes, image_size
from materialist.studio import SETTINGS
from materialist.studio.workspace import store

MESHES = (".glb", ".ply", ".obj", ".stl")


def stored(workspace: Path, file: Path, option: str) -> str:
    """Check an uploaded file and copy it to a workspace, for an option of an edit; returns its name there."""
    suffix = (checked_mesh if option == "mesh" else checked_picture)(file)
    return store(workspace, option, file.read_bytes(), suffix)


def used(workspace: Path, file: Path, option: str, use: Callable[[str], Any]) -> None:
    """`stored`, and use(name); a file that is refused there does not stay."""
    before = {*workspace.iterdir()}
    name = stored(workspace, file, option)
    try:
        use(name)
    except Exception:
        if workspace / name not in before:
            (workspace / name).unlink()
        raise


def checked_picture(path: Path) -> str:
    """The suffix of an uploaded picture. Raises InputError for what is no picture, or too large."""
    suffix, shown = path.suffix.lower(), shown_name(path)
    if suffix not in SUFFIXES:
        raise InputError(f"{shown} is not a photo this program reads; give a PNG, JPEG, HEIC, TIFF, WEBP, EXR or HDR.")
    check_bytes(path, shown)
    if suffix not in RAW_SUFFIXES:
        try:
            (width, height), decoded = image_size(path), decoded_bytes(path)
        except InputError:
            raise
        except Exception as error:  # decoders raise anything
            raise InputError(f"{shown} is not an image that can be read; export it as PNG or JPEG.") from error
        if decoded > 12 * SETTINGS.upload_pixels:
            raise InputError(
                f"{shown} is {width} x {height} = {width * height / 1e6:.0f} megapixels, {decoded / 1e6:.0f} MB in "
                f"memory, above {12e-6 * SETTINGS.upload_pixels:.0f} MB: shrink it, or save its colours alone."
            )
        check_size(width, height, shown)
    return suffix


def checked_mesh(path: Path) -> str:
    """The suffix of an uploaded mesh, whose reader follows no reference out of its folder. Raises InputError."""
    suffix, shown = path.suffix.lower(), shown_name(path)
    if suffix not in MESHES:
        raise InputError(f"{shown} is not a mesh the studio takes; give one .glb, .ply, .obj or .stl file.")
    check_bytes(path, shown)
    return suffix


def shown_name(path: Path) -> str:
    """The user's name of a file, on one line for a message."""
    return " ".join(path.name.split())[:60] or "The file"


def check_bytes(path: Path, shown: str) -> None:
    """Raises InputError for a file that was cleared away, an empty one, and one that is too large."""
    if not path.is_file():
        raise InputError(f"{shown} is no longer here; give it again.")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{shown} is empty (0 bytes); copy it again.")
    if size > SETTINGS.upload_megabytes * 1e6:
        raise InputError(f"{shown} has {size / 1e6:.0f} MB; the studio takes up to {SETTINGS.upload_megabytes} MB.")
