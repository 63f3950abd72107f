"""TIFF of 8 and 16 bits a channel with a profile and EXIF; Pillow writes no 16-bit RGB."""

import struct
import zlib
from typing import Any

from PIL import ExifTags, Image
from PIL.TiffImagePlugin import ImageFileDirectory_v2

from materialist.types import Array

_DEFLATE = 8
_RGB = 2
_PREDICTED = 2
_ROWS = 64
"""Rows of a strip."""


def tiff_bytes(levels: Array, exif: Image.Exif, profile: bytes) -> bytes:
    """A TIFF of [H, W, 3] uint8 or uint16: a directory, and deflated strips of horizontal differences."""
    # --- The strips, and where each lies after the directory ---
    height, width = levels.shape[:2]
    strips = [_strip(levels[start : start + _ROWS]) for start in range(0, height, _ROWS)]
    offsets = [0]  # of the directory's end: Pillow adds where that lies
    for strip in strips:
        offsets.append(offsets[-1] + len(strip))
    # --- The directory: layout of the strips, then the photo's EXIF ---
    layout: dict[str, Any] = {
        "ImageWidth": width,
        "ImageLength": height,
        "BitsPerSample": (8 * levels.itemsize,) * 3,
        "Compression": _DEFLATE,
        "PhotometricInterpretation": _RGB,
        "StripOffsets": tuple(offsets[:-1]),
        "SamplesPerPixel": 3,
        "RowsPerStrip": _ROWS,
        "StripByteCounts": tuple(map(len, strips)),
        "PlanarConfiguration": 1,
        "Predictor": _PREDICTED,
        "InterColorProfile": profile,
    }
    directory = ImageFileDirectory_v2(prefix=b"II")
    numbers = {name: number for number, name in ExifTags.TAGS.items()} | {
        "Predictor": 317,
        "InterColorProfile": 34675,
    }
    for name, value in layout.items():
        directory[numbers[name]] = value
    for number, value in exif.items():
        directory[number] = value
    for number in (ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo):
        if kept := exif.get_ifd(number):
            directory[number] = dict(kept)
    # Little-endian, 42, and the directory right after these 8 bytes.
    head = b"II" + struct.pack("<HI", 42, 8)
    return b"".join([head, directory.tobytes(8), *strips])


def _strip(rows: Array) -> bytes:
    """Rows as differences from the pixel to the left, deflated."""
    differences = rows.copy()
    # Unsigned numbers wrap around, as the predictor expects.
    differences[:, 1:] -= rows[:, :-1]
    return zlib.compress(differences.astype(rows.dtype.newbyteorder("<")).tobytes(), 6)
