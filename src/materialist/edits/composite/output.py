"""Composites as files: as deep as the photo was."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from materialist.io.decode import RAW_SUFFIXES
from materialist.io.image import write_image
from materialist.types import Array, Photo


def write_composite(path: str | Path, picture: Array, photo: Photo, *, force: bool = False) -> None:
    """Write linear [H, W, 3] to PATH.exr (float32, HDR kept) or PATH.png, with 16 bits if the photo had more than 8.

    A pixel that is the photo's gets the photo's own 8 or 16 bits back, or, as EXR, the value that an HDR file has.
    Whole or not at all. Raises OutputError or InputError as `write_image`.
    """
    if Path(path).suffix.lower() == ".exr" and photo.stops:
        picture = picture * np.float32(2.0**-photo.stops)
    write_image(path, picture, deep=is_deep(photo), force=force)


def is_deep(photo: Photo) -> bool:
    """Whether the photo came from a display file of more than 8 bits a channel: 16-bit PNG, TIFF, camera RAW."""
    if photo.deep:
        return True
    head = (photo.source or b"")[:32]
    if head.startswith(b"\x89PNG"):
        return len(head) > 24 and head[24] == 16
    if Path(photo.path or "").suffix.lower() in RAW_SUFFIXES:
        return True
    return head.startswith((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"))
