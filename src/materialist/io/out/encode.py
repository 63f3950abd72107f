"""Pictures out: PNG, JPEG, TIFF, WebP, AVIF and EXR by suffix, with the colours and the EXIF of the photo."""

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, features

from materialist.color import ROWS
from materialist.errors import InputError, OutputError, SetupError
from materialist.install import install_command
from materialist.io.atomic import ensure_writable, whole_file
from materialist.io.exr import write_exr
from materialist.io.out.colours import SRGB, PhotoColours, photo_colours
from materialist.io.out.depth import is_deep
from materialist.io.out.exif import copied_exif, exr_attributes
from materialist.io.out.tiff import tiff_bytes
from materialist.spelling import spelled
from materialist.types import Array, Photo, Scene

KINDS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
    ".avif": "AVIF",
    ".exr": "EXR",
}
"""Suffix -> format."""
QUALITY = {"JPEG": 95, "WEBP": 90, "AVIF": 85}
"""Quality of the formats that lose something, unless the caller says otherwise; by eye."""
LOSSLESS = 100
"""Quality from which WebP loses nothing."""
MAX_SIDE = {"JPEG": 65_535, "WEBP": 16_383, "AVIF": 65_535}
"""Longest side that the format has, pixels."""
_PNG_EFFORT = 3
"""Of 9: a third of the time of 6, and 6 % more bytes of a photo of 50 megapixels."""
_SUBSAMPLING = {"JPEG": 0, "AVIF": "4:4:4"}
"""Colour at every pixel: borders of edits are where both change."""
_EXIF_BYTES = 65_000
"""Room for EXIF in a JPEG."""
_MAKER_NOTE = 37_500
_IN_PNG_BEFORE = 33
"""Bytes of a PNG's signature and header chunk."""


@spelled
def save_image(
    path: str | Path,
    picture: Array,
    photo: Photo | Scene | None = None,
    *,
    quality: int | None = None,
    bits: int | None = None,
    force: bool = False,
) -> tuple[str, ...]:
    """Write a picture to PATH.png, .jpg, .tif, .webp, .avif (display values) or .exr (linear float32).

    With the `photo` that it was made of, the file has that photo's colour space and profile, its bits a channel and its
    EXIF (upright; the software is this program); an EXR the unit of an HDR photo, and of its EXIF what has a standard
    attribute. A pixel that is still the photo's
    has the photo's own levels in formats that lose nothing: PNG, TIFF, and WebP of quality 100.

    Args:
        picture: [H, W, 3] float32 linear Rec.709, as `composite` and `render_scene` give it.
        photo: the photo, or the scene that has it; None for sRGB without EXIF.
        quality: 1 to 100, of JPEG (default 95), WebP (90) and AVIF (85). Below 100 WebP has colour at half the
            resolution.
        bits: 8 or 16 a channel, of PNG and TIFF; None takes the photo's.
        force: replace a file that is there.

    Returns notes on what the file lacks. Raises InputError for another suffix, shape or number; OutputError where the
    file exists without `force`, or cannot be written; SetupError for AVIF without its encoder.
    """
    # --- A picture of three channels that the format can hold ---
    check_image_output(path, quality=quality, bits=bits, force=force)
    kind = KINDS[Path(path).suffix.lower()]
    photo = photo.photo if isinstance(photo, Scene) else photo
    picture = np.asarray(picture, np.float32)
    if picture.ndim != 3 or picture.shape[2] != 3 or not picture.size:
        raise InputError(f"The picture is {list(picture.shape)}; give linear RGB [H, W, 3].")
    if max(picture.shape[:2]) > MAX_SIDE.get(kind, max(picture.shape)):
        raise InputError(
            f"{kind} has at most {MAX_SIDE[kind]} pixels on a side; write {path} as PNG or TIFF."
        )
    # --- EXR: light, in the unit of an HDR photo ---
    colours = SRGB if photo is None else photo_colours(photo)
    if kind == "EXR":
        light = colours.whole(picture)
        stops = 0 if photo is None else photo.stops
        with whole_file(path, force) as temporary:
            shown = light * np.float32(2.0**-stops) if stops else light
            write_exr(temporary, shown, exr_attributes(photo))
        return ()
    # --- Display files: levels in the photo's own colours ---
    deep = kind in ("PNG", "TIFF") and (
        bits == 16 or (bits is None and photo is not None and is_deep(photo))
    )
    levels = colours.levels(picture, np.uint16 if deep else np.uint8)
    content, notes = _encoded(kind, levels, colours, photo, quality)
    with whole_file(path, force) as temporary, temporary.open("wb") as file:
        file.writelines(content)
    return (*colours.notes, *notes)


def check_image_output(
    path: str | Path, *, quality: int | None = None, bits: int | None = None, force: bool = False
) -> None:
    """Check, before hours of work, that `save_image` will accept PATH and these options; raises as that."""
    kind = KINDS.get(Path(path).suffix.lower())
    if kind is None:
        raise InputError(
            f"The output {path} must end in .png, .jpg, .tif, .webp or .avif (for looking), or .exr (linear, for "
            "further work)."
        )
    # --- Quality for lossy formats, bits for PNG and TIFF ---
    if quality is not None and (
        kind not in QUALITY or not 1 <= quality <= 100 or quality != int(quality)
    ):
        known = " and ".join((", ".join(list(QUALITY)[:-1]), list(QUALITY)[-1]))
        raise InputError(
            f"The quality is {quality} for {path}; {known} take whole numbers from 1 to 100."
        )
    if bits is not None and (
        bits not in (8, 16) or (bits == 16 and kind not in ("PNG", "TIFF")) or kind == "EXR"
    ):
        raise InputError(
            f"{path} cannot have {bits} bits a channel; PNG and TIFF have 8 or 16, EXR has floats of 32."
        )
    if kind == "AVIF" and not features.check("avif"):
        raise SetupError(f"AVIF needs a Pillow with its encoder: {install_command('pillow>=11.3')}")
    ensure_writable(path, force, None)


def _encoded(
    kind: str, levels: Array, colours: PhotoColours, photo: Photo | None, quality: int | None
) -> tuple[list[bytes | memoryview], tuple[str, ...]]:
    """The file's bytes, part by part, and notes on what it lacks; `levels` are used up."""
    exif = copied_exif(photo, srgb=colours.space is None)
    if kind == "TIFF":
        return [tiff_bytes(levels, exif, colours.profile)], ()
    # --- EXIF, as far as the format has room for it ---
    described = exif.tobytes()
    notes: tuple[str, ...] = ()
    if kind == "JPEG" and len(described) > _EXIF_BYTES:
        exif.get_ifd(34665).pop(_MAKER_NOTE, None)
        described = exif.tobytes()
        notes = ("The camera maker's own note is left out: JPEG has no room for it.",)
    if kind == "PNG":
        return _png(levels, described, colours.profile), notes
    # --- Pillow writes all but PNG, which OpenCV writes with less memory, and of 16 bits, too ---
    settings: dict[str, Any] = {"exif": described, "icc_profile": colours.profile}
    if kind in QUALITY:
        settings["quality"] = QUALITY[kind] if quality is None else quality
    if kind in _SUBSAMPLING:
        settings["subsampling"] = _SUBSAMPLING[kind]
    if kind == "WEBP" and quality == LOSSLESS:
        settings |= {"lossless": True, "quality": 75}  # then it says how hard it tries
    buffer = io.BytesIO()
    try:
        Image.fromarray(levels).save(buffer, kind, **settings)
    except (OSError, ValueError) as error:  # what the encoders raise, for example out of memory
        raise OutputError(f"The picture cannot be encoded as {kind}: {error}.") from error
    return [buffer.getbuffer()], notes


def _png(levels: Array, exif: bytes, profile: bytes) -> list[bytes | memoryview]:
    """A PNG of 8 or 16 bits, with the chunks that OpenCV does not write."""
    for start in range(0, len(levels), ROWS):  # in place, for the memory
        levels[start : start + ROWS] = levels[start : start + ROWS, :, ::-1].copy()
    effort = [cv2.IMWRITE_PNG_COMPRESSION, _PNG_EFFORT]
    encoded: Array = cv2.imencode(".png", levels, effort)[1]
    plain = encoded.data.cast("B")
    chunks = _chunk(b"iCCP", b"ICC profile\0\0" + zlib.compress(profile))
    chunks += _chunk(b"eXIf", exif.removeprefix(b"Exif\0\0"))
    return [plain[:_IN_PNG_BEFORE], chunks, plain[_IN_PNG_BEFORE:]]


def _chunk(kind: bytes, content: bytes) -> bytes:
    return (
        struct.pack(">I", len(content))
        + kind
        + content
        + struct.pack(">I", zlib.crc32(kind + content))
    )
