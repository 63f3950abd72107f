"""Photographs that programs hand over: open files, Pillow's pictures and arrays, each read as a file of it would be."""

import io
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, TypeAlias

import cv2
import numpy as np
from PIL import Image

from materialist.errors import InputError, MaterialistError
from materialist.io.exr import write_exr
from materialist.io.photo import read_photo
from materialist.types import Array, Photo

PhotoInput: TypeAlias = "str | Path | Photo | IO[bytes] | Image.Image | Array"
"""A file's name, a photo, an open file, a picture of Pillow's, or an array."""
_AS_PNG = ("1", "L", "LA", "P", "PA", "RGB", "RGBA", "I;16")
"""Pillow's modes that a PNG keeps."""


def photo_of(photo: Any, *, encoded: bool | None = None, **settings: Any) -> Photo:
    """The Photo of anything in `PhotoInput` but a Photo; `settings` are those of `read_photo`.

    An array is [H, W, 3], [H, W, 4] with alpha, or [H, W]: floats of linear Rec.709, or with `encoded` sRGB display
    values (uint8, uint16, or floats in [0, 1], which are kept at 16 bits).

    Raises InputError for what is none of these, and as `read_photo`.
    """
    if isinstance(photo, str | Path):
        _refuse_encoded(encoded, "a file")
        return read_photo(photo, **settings)
    if isinstance(photo, Image.Image):
        _refuse_encoded(encoded, "a picture of Pillow's")
        return _read(_picture_bytes(photo), "The picture", _name(photo, "filename"), settings)
    if hasattr(photo, "read"):
        _refuse_encoded(encoded, "an open file")
        return _read(_content(photo), "The open file", _name(photo, "name"), settings)
    return _read(_array_bytes(_array(photo), bool(encoded)), "The array", None, settings)


def _refuse_encoded(encoded: bool | None, kind: str) -> None:
    if encoded is not None:
        raise InputError(
            f"encoded says what an array holds; leave it out for {kind}, which says so itself."
        )


def _name(source: Any, attribute: str) -> str | None:
    """The file name that an open file or a picture has; some have a number."""
    name = getattr(source, attribute, None)
    return name if isinstance(name, str) and name else None


def _read(content: bytes, called: str, name: str | None, settings: dict[str, Any]) -> Photo:
    """Read the bytes of a file. Messages call it by `name`, or as it is `called`."""
    with tempfile.TemporaryDirectory() as folder:
        # The readers know files: their checks, limits and messages then hold here as well.
        file = Path(folder) / f"photo{Path(name or '').suffix}"
        file.write_bytes(content)
        try:
            return replace(read_photo(file, **settings), path=name)
        except MaterialistError as error:
            raise type(error)(str(error).replace(str(file), name or called)) from error


def _content(file: Any) -> bytes:
    """The rest of an open file. Raises InputError for one of text."""
    content = file.read()
    if not isinstance(content, bytes):
        raise InputError(
            "The open file gives text; open photos in binary mode, as in open(path, 'rb')."
        )
    return content


def _picture_bytes(picture: Image.Image) -> bytes:
    """A file that keeps every level of a picture, its profile and its EXIF."""
    if picture.mode == "F":
        return _array_bytes(np.asarray(picture), encoded=False)
    buffer = io.BytesIO()
    # What the file would say of colours and camera goes along.
    kept = {"icc_profile": picture.info.get("icc_profile"), "exif": picture.getexif().tobytes()}
    try:
        picture.save(
            buffer,
            "PNG" if picture.mode in _AS_PNG else "TIFF",
            **{k: v for k, v in kept.items() if v},
        )
    except (OSError, ValueError) as error:
        raise InputError(
            f"A picture of mode {picture.mode} cannot be read; convert it to RGB."
        ) from error
    return buffer.getvalue()


def _array(photo: Any) -> Array:
    """A numeric array of a picture's shape. Raises InputError."""
    try:
        array = np.asarray(photo)
    except Exception as error:  # whatever an object's __array__ raises
        raise InputError(f"A {type(photo).__name__} is no photo: {error}.") from error
    if array.dtype.kind not in "fu" or array.dtype.itemsize > 8:
        raise InputError(
            f"A photo is a file's name, an open file, a picture of Pillow's, or an array of floats, uint8 or uint16; "
            f"this is {type(photo).__name__} of {array.dtype}."
        )
    if array.ndim not in (2, 3) or array.shape[2:] not in ((), (1,), (3,), (4,)):
        raise InputError(
            f"The array is {list(array.shape)}; a photo is [H, W, 3], [H, W, 4] or [H, W]."
        )
    return array[..., 0] if array.shape[2:] == (1,) else array


def _array_bytes(array: Array, encoded: bool) -> bytes:
    """The file of an array: an EXR of linear values, or a PNG of display values."""
    if not encoded:
        if array.dtype.kind == "u":
            raise InputError(
                f"The array holds {array.dtype}, which are display values: give encoded=True, or linear floats."
            )
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "photo.exr"
            write_exr(file, array)
            return file.read_bytes()
    if array.dtype.kind == "f":
        if not (np.isfinite(array).all() and array.min() >= 0 and array.max() <= 1):
            raise InputError(
                f"Encoded floats must lie in [0, 1]; these go from {array.min():.4g} to {array.max():.4g}. Divide "
                "levels by 255, or leave encoded out for linear values."
            )
        # 16 bits keep what an 8-bit step would lose.
        array = np.round(array.astype(np.float64) * 65535).astype(np.uint16)
    if array.dtype not in (np.uint8, np.uint16):
        raise InputError(f"The array holds {array.dtype}; give uint8, uint16, or floats in [0, 1].")
    # OpenCV writes B, G, R.
    order = {(3,): [2, 1, 0], (4,): [2, 1, 0, 3]}.get(array.shape[2:])
    levels = np.ascontiguousarray(array if order is None else array[..., order])
    return cv2.imencode(".png", levels)[1].tobytes()
