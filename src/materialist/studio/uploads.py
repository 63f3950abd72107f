"""Uploaded files: checked by size and header before anything is decoded, and stored under names of ours."""

import re
from pathlib import Path

from materialist.errors import InputError
from materialist.io.bitmap import check_size
from materialist.io.decode import RAW_SUFFIXES, SUFFIXES, image_size
from materialist.studio import SETTINGS
from materialist.studio.workspace import store

MESHES = (".glb", ".ply", ".obj", ".stl")


def stored(workspace: Path, file: Path, option: str) -> str:
    """Check an uploaded file and copy it to a workspace, for an option of an edit; returns its name there."""
    suffix = (checked_mesh if option == "mesh" else checked_picture)(file)
    return store(workspace, option, file.read_bytes(), suffix)


def checked_picture(path: Path) -> str:
    """The suffix of an uploaded picture. Raises InputError for what is no picture, or too large."""
    suffix, shown = path.suffix.lower(), shown_name(path)
    if suffix not in SUFFIXES:
        raise InputError(f"{shown} is not a photo this program reads; give a PNG, JPEG, HEIC, TIFF, WEBP, EXR or HDR.")
    check_bytes(path, shown)
    if suffix not in RAW_SUFFIXES:
        try:
            width, height = image_size(path)
        except InputError:
            raise
        except Exception as error:  # decoders raise anything
            raise InputError(f"{shown} is not an image that can be read; export it as PNG or JPEG.") from error
        if width * height > SETTINGS.upload_pixels:
            raise InputError(
                f"{shown} is {width} x {height} = {width * height / 1e6:.0f} megapixels; the studio takes up to "
                f"{SETTINGS.upload_pixels / 1e6:.0f}: shrink it first."
            )
        check_size(width, height, shown)
    return suffix


def checked_mesh(path: Path) -> str:
    """The suffix of an uploaded mesh. Raises InputError for a kind that could name other files.

    PLY, STL and binary glTF hold everything in one file; OBJ is taken without its material library.
    """
    suffix, shown = path.suffix.lower(), shown_name(path)
    if suffix not in MESHES:
        raise InputError(f"{shown} is not a mesh the studio takes; give one .glb, .ply, .obj or .stl file.")
    check_bytes(path, shown)
    content = path.read_bytes()
    if suffix == ".glb" and re.search(rb'"uri"\s*:\s*"(?!data:)', content):
        raise InputError(f"{shown} refers to other files; export it with everything embedded.")
    if suffix == ".obj" and re.search(rb"(?m)^\s*(mtllib|usemap|map_\w+|call|csh)\b", content):
        path.write_bytes(re.sub(rb"(?m)^\s*(mtllib|usemap|map_\w+|call|csh)\b.*$", b"", content))
    return suffix


def shown_name(path: Path) -> str:
    """The user's name of a file, on one line for a message."""
    return " ".join(path.name.split())[:60] or "The file"


def check_bytes(path: Path, shown: str) -> None:
    """Raises InputError for an empty file, and for one that is too large."""
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{shown} is empty (0 bytes); copy it again.")
    if size > SETTINGS.upload_megabytes * 1e6:
        raise InputError(f"{shown} has {size / 1e6:.0f} MB; the studio takes up to {SETTINGS.upload_megabytes} MB.")
