"""How many bits a channel a photo's file has."""

import io
from pathlib import Path

from tifffile import TiffFile

from materialist.io.decode import RAW_SUFFIXES
from materialist.types import Photo

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def is_tiff(content: bytes) -> bool:
    """Whether a file begins as a TIFF does."""
    return content[:4] in _TIFF


def is_deep(photo: Photo) -> bool:
    """Whether the photo came from a display file of more than 8 bits a channel: 16-bit PNG, TIFF, camera RAW."""
    if photo.deep:
        return True
    source = photo.source or b""
    if source.startswith(b"\x89PNG"):
        return len(source) > 24 and source[24] == 16
    if Path(photo.path or "").suffix.lower() in RAW_SUFFIXES:
        return True
    return is_tiff(source) and TiffFile(io.BytesIO(source)).pages.first.bitspersample > 8
