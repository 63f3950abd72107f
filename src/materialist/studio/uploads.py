"""Uploaded files: opened in a process with limits first, then stored under names of ours.

The functions that take a `report` run in that process, the others in the server, which opens no file before one of
them has.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import InputError
from materialist.io.bitmap import check_size
from materialist.io.decode import RAW_SUFFIXES, SUFFIXES, decode, decoded_bytes, image_size
from materialist.io.image import read_map
from materialist.jobs.limited import Limits, run_limited
from materialist.studio import SETTINGS
from materialist.studio.workspace import store

MESHES = (".glb", ".ply", ".obj", ".stl")
PHOTO, MESH = "photo", "mesh"
"""Options that are no data of an edit's picture: the photo to take apart, and the mesh of an object."""
_COLOURS = ("texture", "background", "envmap")
"""Options whose picture is colour; the others are masks and maps of numbers."""


# --- In the server ---


def opened(task: Callable[..., Any], file: Path, **arguments: Any) -> Any:
    """What `task(report, file=..., **arguments)` returns of an uploaded file, done in a process with limits.

    Raises InputError, which names the file as its owner does.
    """
    shown = shown_name(file)
    check_bytes(file, shown)
    limits = Limits(SETTINGS.opening_memory, SETTINGS.opening_seconds)
    try:
        return run_limited(task, limits, file=file, **arguments)
    except InputError as error:
        reason = str(error)
        raise InputError(reason if shown in reason else f"{shown}: {reason}") from error


def used(workspace: Path, file: Path, option: str, use: Callable[[str], Any]) -> None:
    """Check an uploaded file, copy it to a workspace and `use(name)` it; one that is refused does not stay."""
    suffix = opened(checked, file, option=option)
    before = {*workspace.iterdir()}
    name = store(workspace, option, file.read_bytes(), suffix)
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
        raise InputError(f"{shown} has {size / 1e6:.0f} MB; the studio takes up to {SETTINGS.upload_megabytes} MB.")


def shown_name(path: Path) -> str:
    """The user's name of a file, on one line for a message."""
    return " ".join(path.name.split())[:60] or "The file"


# --- In the process with limits ---


def checked(report: Any, file: Path, option: str) -> str:
    """The suffix of a file that can be read as an option needs it: its header first, then all of it.

    A photo's header alone is read: its inversion has a process of its own. Raises InputError.
    """
    if option == MESH:
        suffix = checked_mesh(file)
        _read_mesh(file)
        return suffix
    suffix = checked_picture(file)
    if option != PHOTO:
        _read_picture(file, option)
    return suffix


def checked_picture(path: Path) -> str:
    """The suffix of an uploaded picture. Raises InputError for what is no picture, or too large, by its header."""
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


def _read_mesh(path: Path) -> None:
    from materialist.edits.insert.meshes import read_model

    read_model(path)


def _read_picture(path: Path, option: str) -> None:
    if option in _COLOURS:
        decode(path)
    else:
        read_map(path)
