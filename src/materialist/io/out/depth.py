"""How many bits a channel a photo's file has."""

import io
from pathlib import Path
from typing import Any

from tifffile import TiffFile

from materialist.io.decode import RAW_SUFFIXES, TIFF
from materialist.types import Photo

_HEIC = tuple(
    b"ftyp" + brand for brand in (b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1")
)
"""How files of these formats begin, HEIC from its fifth byte on."""


def is_tiff(content: bytes) -> bool:
    """Whether a file begins as a TIFF does."""
    return content[:4] in TIFF


def is_deep(photo: Photo) -> bool:
    """Whether the photo came from a display file of more than 8 bits a channel: PNG, TIFF, HEIC, camera RAW."""
    if photo.deep:
        return True
    source = photo.source or b""
    if source.startswith(b"\x89PNG"):
        return len(source) > 24 and source[24] == 16
    if Path(photo.path or "").suffix.lower() in RAW_SUFFIXES:
        return True
    # The header of the first page; Pillow would cut what is deeper.
    if is_tiff(source):
        return TiffFile(io.BytesIO(source)).pages.first.bitspersample > 8
    return source[4:12] in _HEIC and _heic_bits(source) > 8


def _heic_bits(source: bytes) -> int:
    from pillow_heif import open_heif

    heif: Any = open_heif(io.BytesIO(source), convert_hdr_to_8bit=False)
    return int(heif.info.get("bit_depth", 8))
