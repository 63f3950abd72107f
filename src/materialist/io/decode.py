"""Image files of any common kind to linear Rec.709 at native size, upright."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError
from tifffile import TiffFile

from materialist.errors import InputError, MaterialistError, SetupError
from materialist.io import bitmap
from materialist.io.bitmap import Decoded
from materialist.io.exif import file_tags
from materialist.io.exr import exr_bytes, exr_headers, exr_size, read_exr
from materialist.io.tiff import read_tiff

RAW_SUFFIXES = frozenset(
    f".{name}"
    for name in (
        *("3fr", "ari", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "iiq", "k25", "kdc", "mef", "mos"),
        *("mrw", "nef", "nrw", "orf", "pef", "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f"),
    )
)
"""File names that mean camera RAW: most are TIFF inside, so the content cannot tell."""
SUFFIXES = RAW_SUFFIXES | {
    ".png", ".jpg", ".jpeg", ".mpo", ".webp", ".heic", ".heif", ".avif", ".tif", ".tiff", ".bmp", ".gif", ".exr", ".hdr"
}  # fmt: skip
"""Usual file names of photos; `decode` reads others, too."""

_EXR, _RADIANCE = b"\x76\x2f\x31\x01", (b"#?RADIANCE", b"#?RGBE")
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""How files of these formats begin."""


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) from the header of an image, turned or not; of any but camera RAW.

    Raises InputError where there is no size, and whatever the readers raise for a damaged file.
    """
    with path.open("rb") as file:
        head = file.read(65536)
    if head.startswith(_EXR):
        return max((exr_size(header) for header in exr_headers(path)), key=math.prod)
    if head.startswith(_RADIANCE):
        size = re.search(rb"\n[-+]Y (\d{1,9}) [-+]X (\d{1,9})\n", head)
        if size is None:
            raise InputError(f"{path} has no size in its Radiance header; export it again.")
        return int(size[2]), int(size[1])
    if head.startswith(_TIFF):  # Pillow does not know some layouts, such as float RGB
        with TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            return int(page.imagewidth), int(page.imagelength)
    from pillow_heif import register_heif_opener

    register_heif_opener()
    try:
        with bitmap.pixel_limit_lifted(), Image.open(path) as image:
            return image.size
    except UnidentifiedImageError as error:
        raise InputError(f"{path} is not an image this program can read; give it a {bitmap.FORMATS} file.") from error


def decoded_bytes(path: Path) -> int:
    """Bytes of an image once decoded, by its header; of an EXR all channels. Otherwise as `image_size`."""
    with path.open("rb") as file:
        return exr_bytes(path) if file.read(4) == _EXR else 12 * math.prod(image_size(path))


def decode(path: Path) -> Decoded:
    """Read any supported image file. Raises InputError, or SetupError when camera RAW support is not installed."""
    try:
        with path.open("rb") as file:
            head = file.read(32)
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder; give one photo in it.") from error
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:
        raise InputError(f"There is no picture at {path}.") from error
    except OSError as error:  # a folder one may not enter, a name that is too long
        raise InputError(f"{path} cannot be read: {(error.strerror or str(error)).lower()}.") from error
    if not head:
        raise InputError(f"{path} is empty (0 bytes); copy it again.")
    try:
        if path.suffix.lower() in RAW_SUFFIXES:
            return _raw(path)
        bitmap.check_size(*image_size(path), path)
        if head.startswith(_EXR):
            return _exr(path)
        if head.startswith(_RADIANCE):
            return Decoded(np.ascontiguousarray(bitmap.stored_pixels(path)[0]), True)  # RGBE
        if head.startswith(_TIFF):
            return read_tiff(path)
        return bitmap.read_bitmap(path)
    except (MaterialistError, MemoryError):
        raise
    except Exception as error:  # decoders raise anything: OSError, SyntaxError, struct.error, EOFError, cv2.error
        raise InputError(f"{path} is damaged or truncated ({error}); export it again.") from error


def _exr(path: Path) -> Decoded:
    """OpenEXR; alpha is premultiplied there."""
    pixels = read_exr(path, photo=True)
    if pixels.ndim == 2:
        pixels = np.repeat(pixels[..., None], 3, -1)
    alpha = pixels[..., 3:] if pixels.shape[-1] == 4 else None
    return bitmap.light_and_alpha(np.ascontiguousarray(pixels[..., :3]), alpha)


def _raw(path: Path) -> Decoded:
    """Camera RAW: demosaiced with the camera's white balance, linear Rec.709, no automatic brightening.

    Raises SetupError where rawpy is not installed, InputError for a file that it cannot read.
    """
    try:
        import rawpy
    except ImportError as error:
        raise SetupError(f"Camera RAW needs one more package to read {path.name}: pip install rawpy") from error
    try:
        with rawpy.imread(str(path)) as raw:
            bitmap.check_size(raw.sizes.width, raw.sizes.height, path)
            pixels = raw.postprocess(gamma=(1, 1), no_auto_bright=True, use_camera_wb=True, output_bps=16)
    except rawpy.LibRawError as error:
        raise InputError(f"{path} is not a RAW file this program can read ({error}); export it as TIFF.") from error
    return Decoded(pixels.astype(np.float32) / np.float32(65535), False, file_tags(path))
