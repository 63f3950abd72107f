"""Uploaded files: opened in a process with limits first, then stored under names of ours.

The functions that take a `report` run in that process, the others in the server, which opens no file before one of
them has.
"""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from materialist.errors import InputError
from materialist.io.bitmap import check_size
from materialist.io.decode import RAW_SUFFIXES, SUFFIXES, decode, image_size, peak_bytes
from materialist.io.image import read_map, write_image
from materialist.jobs.limited import Limits, run_limited
from materialist.studio import SETTINGS
from materialist.studio.access.quota import Allowance
from materialist.studio.stored import store

MESHES = (".glb", ".ply", ".obj", ".stl")
PHOTO = "photo"
MESH = "mesh"
"""Options that are no data of an edit's picture: the photo to take apart, and the mesh of an object."""
_COLOURS = ("texture", "background", "envmap")
"""Options whose picture is colour; the others are masks and maps of numbers."""


# --- In the server ---


def opened_upload(
    task: Callable[..., Any], file: Path, allowance: Allowance, **arguments: Any
) -> Any:
    """What `task(report, file=..., **arguments)` returns of an uploaded file, done in a process with limits.

    Raises InputError, which names the file as its owner does, or says that too many are being opened.
    """
    shown = shown_name(file)
    check_bytes(file, shown)
    limits = Limits(SETTINGS.opening_memory, SETTINGS.opening_seconds)
    try:
        # In a process with limits: a file made by a stranger may be a bomb.
        with allowance.opening():
            return run_limited(task, limits, file=file, **arguments)
    except InputError as error:
        reason = str(error)
        raise InputError(reason if shown in reason else f"{shown}: {reason}") from error


def used(
    workspace: Path, file: Path, option: str, allowance: Allowance, use: Callable[[str], Any]
) -> None:
    """Check an uploaded file, copy it to a workspace and `use(name)` it; one that is refused does not stay."""
    readable = opened_upload(checked_upload, file, allowance, option=option)
    # Equal content has an equal name: a file that was there before stays.
    before = {*workspace.iterdir()}
    content = readable.read_bytes()
    allowance.claim(len(content))
    name = store(workspace, option, content, readable.suffix.lower())
    try:
        use(name)
    except Exception:
        if workspace / name not in before:
            (workspace / name).unlink()
        raise


def check_bytes(path: Path, shown: str) -> None:
    """Raises InputError for a file that was cleared away, an empty one, and one that is too large."""
    if not path.is_file():
        raise InputError(f"{shown} is no longer here; give it again.")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{shown} is empty (0 bytes); copy it again.")
    if size > SETTINGS.upload_megabytes * 1e6:
        raise InputError(
            f"{shown} has {size / 1e6:.0f} MB; the studio takes up to {SETTINGS.upload_megabytes} MB."
        )


def shown_name(path: Path) -> str:
    """The user's name of a file, on one line for a message."""
    return " ".join(path.name.split())[:60] or "The file"


# --- In the process with limits ---


def checked_upload(report: Any, file: Path, option: str) -> Path:
    """The file that the server may read for an option: the given one, or a smaller one of the same picture beside it.

    Its header is read first, then all of it; of a photo the header alone: its inversion has a process of its own.
    Raises InputError for what cannot be read, and for what would be too large for the server.
    """
    # Meshes are read in full: a header does not tell how large one becomes.
    if option == MESH:
        checked_mesh(file)
        _read_mesh(file)
        return file
    checked_picture(file)
    if option == PHOTO:
        return file
    return _shrunk(file) if option in _COLOURS else _read_map(file)


def checked_picture(path: Path) -> None:
    """Raise InputError for an uploaded file that is no picture, or too large, by its header."""
    suffix = path.suffix.lower()
    shown = shown_name(path)
    if suffix not in SUFFIXES:
        raise InputError(
            f"{shown} is not a photo this program reads; give a PNG, JPEG, HEIC, TIFF, WEBP, EXR or HDR."
        )
    check_bytes(path, shown)
    # Headers of RAW do not tell the size that it decodes to.
    if suffix not in RAW_SUFFIXES:
        try:
            (width, height), peak = image_size(path), peak_bytes(path)
        except InputError:
            raise
        except Exception as error:  # decoders raise anything
            raise InputError(
                f"{shown} is not an image that can be read; export it as PNG or JPEG."
            ) from error
        megapixels = width * height / 1e6
        if width * height > SETTINGS.upload_pixels or peak > SETTINGS.opening_memory:
            raise InputError(
                f"{shown} is {width} x {height} = {megapixels:.0f} megapixels and takes {peak / 1e9:.1f} GB to read; "
                f"the studio takes up to {SETTINGS.upload_pixels / 1e6:g} megapixels and "
                f"{SETTINGS.opening_memory / 1e9:g} GB: shrink it, or save its colours alone."
            )
        check_size(width, height, shown)


def checked_mesh(path: Path) -> None:
    """Raise InputError for an uploaded file that is no mesh whose reader stays in its folder."""
    shown = shown_name(path)
    if path.suffix.lower() not in MESHES:
        raise InputError(
            f"{shown} is not a mesh the studio takes; give one .glb, .ply, .obj or .stl file."
        )
    check_bytes(path, shown)


def _read_mesh(path: Path) -> None:
    from materialist.edits.insert.meshes import read_model

    model = read_model(path)
    faces = sum(len(part.faces) for part in model.parts)
    if faces > SETTINGS.mesh_faces:
        raise InputError(
            f"{shown_name(path)} has {faces:,} faces; the studio takes up to {SETTINGS.mesh_faces:,}. Simplify it."
        )


def _shrunk(path: Path) -> Path:
    """A picture of colours that is small enough for the server: the file itself, or a PNG or EXR beside it."""
    decoded = decode(path)
    height, width = decoded.linear.shape[:2]
    # Both sides by the root: the limit is one of pixels.
    scale = math.sqrt(SETTINGS.edit_pixels / (width * height))
    if scale >= 1:
        return path
    size = (max(1, int(width * scale)), max(1, int(height * scale)))
    linear = np.asarray(cv2.resize(decoded.linear, size, interpolation=cv2.INTER_AREA))
    smaller = path.with_name(f"{path.stem}.smaller{'.exr' if decoded.scene_linear else '.png'}")
    write_image(smaller, linear, deep=True, force=True)
    return smaller


def _read_map(path: Path) -> Path:
    """A map of numbers or a mask, which can be read. Raises InputError for one too large for the server."""
    if path.suffix.lower() not in RAW_SUFFIXES:
        width, height = image_size(path)
        if width * height > SETTINGS.edit_pixels:
            raise InputError(
                f"{shown_name(path)} is {width} x {height} pixels; a mask or map may have up to "
                f"{SETTINGS.edit_pixels / 1e6:g} megapixels: shrink it."
            )
    read_map(path)
    return path
