"""Image files of any common kind to linear Rec.709 at native size, upright."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError
from tifffile import TiffFile

from materialist.errors import InputError, MaterialistError, SetupError
from materialist.install import extra_command
from materialist.io import bitmap
from materialist.io.bitmap import Decoded
from materialist.io.exif import file_tags
from materialist.io.exr import exr_bytes, exr_headers, exr_size
from materialist.io.exr_photo import read_exr_photo
from materialist.io.native import unprinted
from materialist.io.radiance import MAGIC, radiance_header, read_radiance
from materialist.io.tiff import read_tiff
from materialist.types import Array

RAW_SUFFIXES = frozenset(
    f".{name}"
    for name in (
        "3fr",
        "ari",
        "arw",
        "cr2",
        "cr3",
        "crw",
        "dcr",
        "dng",
        "erf",
        "fff",
        "iiq",
        "k25",
        "kdc",
        "mef",
        "mos",
        "mrw",
        "nef",
        "nrw",
        "orf",
        "pef",
        "raf",
        "raw",
        "rw2",
        "rwl",
        "sr2",
        "srf",
        "srw",
        "x3f",
    )
)
"""File names that mean camera RAW: most are TIFF inside, so the content cannot tell."""
SUFFIXES = RAW_SUFFIXES | {
    f".{name}"
    for name in (
        "png",
        "apng",
        "jpg",
        "jpeg",
        "jpe",
        "jif",
        "jfif",
        "mpo",
        "webp",
        "heic",
        "heif",
        "hif",
        "avif",
        "bmp",
        "dib",
        "gif",
        "tif",
        "tiff",
        "jp2",
        "j2k",
        "jpx",
        "jpf",
        "exr",
        "hdr",
        "tga",
        "ppm",
        "pgm",
        "pnm",
    )
}
"""Usual file names of photos; `decode` reads others, too."""

_EXR = b"\x76\x2f\x31\x01"
TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
"""How files of these formats begin."""


def image_size(path: Path) -> tuple[int, int]:
    """(width, height) from the header of an image, turned or not; of any but camera RAW.

    Raises InputError where there is no size, and whatever the readers raise for a damaged file.
    """
    with path.open("rb") as file:
        head = file.read(32)
    # Headers alone: no pixel is decoded here.
    if head.startswith(_EXR):
        return max((exr_size(header) for header in exr_headers(path)), key=math.prod)
    if head.startswith(MAGIC):
        return radiance_header(path).size
    if head.startswith(TIFF):  # Pillow does not know some layouts, such as float RGB
        with unprinted(), TiffFile(path) as tiff:
            page: Any = tiff.pages[0]
            return int(page.imagewidth), int(page.imagelength)
    from pillow_heif import register_heif_opener

    register_heif_opener()
    try:
        with bitmap.pixel_limit_lifted(), Image.open(path) as image:
            return image.size
    except UnidentifiedImageError as error:
        raise InputError(
            f"{path} is not an image this program can read; give it a {bitmap.FORMATS} file."
        ) from error


def decoded_bytes(path: Path) -> int:
    """Bytes of an image once decoded, by its header; of an EXR all channels. Otherwise as `image_size`."""
    with path.open("rb") as file:
        return exr_bytes(path) if file.read(4) == _EXR else 12 * math.prod(image_size(path))


def peak_bytes(path: Path) -> int:
    """The most memory that `read_photo` takes, bytes, predicted from the header. Otherwise as `image_size`.

    At most 24 bytes a pixel beside all channels of an EXR, 32 beside the file of any other kind, as measured.
    """
    with path.open("rb") as file:
        is_exr = file.read(4) == _EXR
    pixels = math.prod(image_size(path))
    return exr_bytes(path) + 24 * pixels if is_exr else path.stat().st_size + 32 * pixels


def decode(path: Path, layer: str | None = None) -> Decoded:
    """Read any supported image file, or one layer of an EXR.

    Raises InputError, or SetupError when camera RAW support is not installed.
    """
    try:
        with path.open("rb") as file:
            head = file.read(32)
    except IsADirectoryError as error:
        raise InputError(f"{path} is a folder; give one photo in it.") from error
    except (FileNotFoundError, NotADirectoryError, ValueError) as error:
        raise InputError(f"There is no picture at {path}.") from error
    except OSError as error:  # a folder one may not enter, a name that is too long
        raise InputError(
            f"{path} cannot be read: {(error.strerror or str(error)).lower()}."
        ) from error
    if not head:
        raise InputError(f"{path} is empty (0 bytes); copy it again.")
    if layer is not None and not head.startswith(_EXR):
        raise InputError(f"{path} is no EXR, so it has no layer '{layer}'; leave the layer out.")
    try:
        # RAW by the name, everything else by its first bytes: suffixes may lie.
        if path.suffix.lower() in RAW_SUFFIXES:
            return _raw(path)
        bitmap.check_size(*image_size(path), path)
        if head.startswith(_EXR):
            return read_exr_photo(path, layer)
        if head.startswith(MAGIC):
            return read_radiance(path)
        if head.startswith(TIFF):
            return read_tiff(path)
        return bitmap.read_bitmap(path)
    except (MaterialistError, MemoryError):
        raise
    except (
        Exception
    ) as error:  # decoders raise anything: OSError, SyntaxError, struct.error, EOFError, cv2.error
        raise InputError(f"{path} is damaged or truncated ({error}); export it again.") from error


def _raw(path: Path) -> Decoded:
    """Camera RAW: demosaiced with the camera's white balance, linear Rec.709, no automatic brightening.

    Raises SetupError where rawpy is not installed, InputError for a file that it cannot read.
    """
    try:
        import rawpy
    except ImportError as error:
        raise SetupError(
            f"Camera RAW needs one more package to read {path.name}: {extra_command('raw')}"
        ) from error
    tags = file_tags(path)
    try:
        with rawpy.imread(str(path)) as raw:
            bitmap.check_size(raw.sizes.width, raw.sizes.height, path)
            # Linear light as the camera recorded it: brightening is left to the fit's exposure.
            pixels = raw.postprocess(
                gamma=(1, 1), no_auto_bright=True, use_camera_wb=True, output_bps=16
            )
            pixels = _cropped(pixels, raw.sizes) if "DNGVersion" in tags else pixels
    except rawpy.LibRawError as error:
        raise InputError(
            f"{path} is not a RAW file this program can read ({error}); export it as TIFF."
        ) from error
    bitmap.check_size(pixels.shape[1], pixels.shape[0], path)
    linear = np.empty(pixels.shape, np.float32)
    np.divide(pixels, np.float32(65535), out=linear)
    return Decoded(linear, False, tags)


def _cropped(pixels: Array, sizes: Any) -> Array:
    """Developed DNG pixels without the border outside DefaultCropOrigin and DefaultCropSize.

    `sizes` are LibRaw's, of the picture before it was turned by `flip` (3: half, 5: left, 6: right).
    """
    # --- Borders of the crop, in the frame of the sensor ---
    left = sizes.crop_left_margin - sizes.left_margin
    top = sizes.crop_top_margin - sizes.top_margin
    right = sizes.width - left - sizes.crop_width
    bottom = sizes.height - top - sizes.crop_height
    is_whole = pixels.shape[:2] in ((sizes.height, sizes.width), (sizes.width, sizes.height))
    if not (
        sizes.crop_width and sizes.crop_height and is_whole and min(left, top, right, bottom) >= 0
    ):
        return pixels
    # --- The same borders after LibRaw has turned the picture ---
    sides = [left, top, right, bottom]
    turns = {3: 2, 5: 3, 6: 1}.get(sizes.flip, 0)  # quarters to the right
    left, top, right, bottom = (sides[(k - turns) % 4] for k in range(4))
    return pixels[top : pixels.shape[0] - bottom, left : pixels.shape[1] - right]
