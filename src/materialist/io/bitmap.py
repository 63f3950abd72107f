"""Pictures of integers and float TIFFs, by Pillow, OpenCV and tifffile, to linear Rec.709."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.decoded import OVER_WHITE, Decoded, check_size
from materialist.io.exif import image_tags
from materialist.io.icc import matrix_profile
from materialist.types import Array

if TYPE_CHECKING:
    from PIL import Image

FORMATS = "PNG, JPEG, HEIC, TIFF, WEBP, EXR, HDR or camera RAW"
PHOTOMETRIC, ORIENTATION, PLANAR, EXTRA = 262, 274, 284, 338
"""Tags of TIFF: what values mean, whether channels lie apart, and what those beyond colour are (1: alpha that colours
are multiplied by)."""


def read_bitmap(path: Path) -> Decoded:
    """Everything Pillow opens: PNG, JPEG, HEIC, TIFF, WEBP, BMP, GIF, AVIF, ..."""
    from PIL import Image, UnidentifiedImageError
    from pillow_heif import register_heif_opener

    register_heif_opener()
    # From an open file: Pillow maps files that it is given by name, and gets the rows of turned ones wrong.
    with _pixel_limit_lifted(), path.open("rb") as file:
        try:
            image = Image.open(file)
        except UnidentifiedImageError as error:
            raise InputError(f"{path} is not an image this program can read; give it a {FORMATS} file.") from error
        with image:
            check_size(*image.size, path)
            image.load()  # finds truncation, also for files whose pixels OpenCV reads below
            warnings = []
            frames = getattr(image, "n_frames", 1)
            if frames > 1 and image.format not in ("MPO", "HEIF", "JPEG"):
                warnings.append(f"The file holds {frames} pictures; the first is used.")
            tags = image_tags(image)
            if _is_deep(image, path):
                linear, scene_linear = _deep(image, path, warnings)
            else:
                linear, scene_linear = _shallow(image, warnings), False
    return Decoded(_upright(linear, int(tags.get("Orientation", 1) or 1)), scene_linear, tags, warnings)


def _is_deep(image: Image.Image, path: Path) -> bool:
    """Whether the file has more than 8 bits a channel (Pillow cuts those to 8 when they are RGB)."""
    if image.format == "PNG":
        with path.open("rb") as file:
            return file.read(25)[24] == 16
    if image.format == "TIFF":
        return max(image.tag_v2.get(258, (8,))) > 8  # type: ignore[attr-defined]
    if image.format == "PPM" and image.mode != "F":
        return _white(path) > 255
    return image.mode in ("I", "F") or image.mode.startswith("I;16")


def _white(path: Path) -> int:
    """The value of white in a binary PGM or PPM; 255 in other files."""
    with path.open("rb") as file:
        words = re.sub(rb"#[^\n]*", b" ", file.read(4096)).split(None, 4)
    return int(words[3]) if words[0] in (b"P5", b"P6") else 255


def _shallow(image: Image.Image, warnings: list[str]) -> Array:
    """8 bits a channel, any Pillow mode, to [H, W, 3] float32 linear."""
    alpha = None
    if image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info:
        image_rgba = image.convert("RGBA")
        alpha = np.asarray(image_rgba)[..., 3].astype(np.float32)[..., None] / 255
        if image.mode not in ("L", "LA", "La"):
            image_rgba.info.update(image.info)
            image = image_rgba
    profile = image.info.get("icc_profile")
    matrix = matrix_profile(profile) if profile else None
    if matrix is not None and image.mode not in ("CMYK", "L", "LA", "1"):
        rgb = np.asarray(image.convert("RGB"))
        linear = _srgb(rgb) if matrix.is_srgb else matrix.linear(rgb, 256)
    else:
        linear = _srgb(np.asarray(_through_lcms(image, profile, warnings)))
    return linear if alpha is None else _over_white(linear, alpha, warnings)


def _through_lcms(image: Image.Image, profile: bytes | None, warnings: list[str]) -> Image.Image:
    """An 8-bit sRGB image, by the embedded profile where there is one that fits, else by Pillow's own conversion."""
    import io

    from PIL import ImageCms

    if profile and matrix_profile(profile) is None:
        try:
            source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
            base = {"GRAY": "L", "RGB ": "RGB", "CMYK": "CMYK"}[source.profile.xcolor_space]
            flat = image if image.mode == base else image.convert(base)
            return ImageCms.profileToProfile(flat, source, ImageCms.createProfile("sRGB"), outputMode="RGB")  # type: ignore[return-value]
        except (ImageCms.PyCMSError, KeyError, OSError, ValueError):
            warnings.append("The embedded colour profile cannot be used; the photo is taken as sRGB.")
    if image.mode == "CMYK":
        warnings.append("CMYK without a usable profile: colours are approximate.")
    return image.convert("RGB")


def _deep(image: Image.Image, path: Path, warnings: list[str]) -> tuple[Array, bool]:
    """16-bit integers and floats, which Pillow would cut to 8 bits, through OpenCV; (linear, scene_linear)."""
    import cv2

    _require_interleaved(image, path)
    decoded = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    if decoded is None:
        raise InputError(f"{path} has an unusual pixel layout; save it as 8- or 16-bit RGB.")
    pixels = np.atleast_3d(np.asarray(decoded))
    scale = {"uint8": 255, "uint16": 65535}.get(pixels.dtype.name, 1)
    if image.format == "PPM" and pixels.dtype == np.uint16:  # of any number of levels
        pixels = np.rint(pixels * (scale / _white(path))).astype(np.uint16)
    grey, alpha = pixels.shape[2] <= 2, None
    if pixels.shape[2] in (2, 4):
        alpha = pixels[..., -1:].astype(np.float32) / np.float32(scale)
    colour = np.repeat(pixels[..., :1], 3, -1) if grey else pixels[..., 2::-1]
    if pixels.dtype.kind == "f":
        linear, scene_linear = np.ascontiguousarray(colour, np.float32), True
    elif pixels.dtype in (np.uint8, np.uint16):
        scene_linear = False
        if _tiff_tag(image, PHOTOMETRIC, 1) == 0:  # white is zero
            colour = scale - colour
        if alpha is not None and _tiff_tag(image, EXTRA, 2) == 1:  # multiplied by it
            colour = np.clip(np.rint(colour / np.maximum(alpha, 1e-6)), 0, scale).astype(pixels.dtype)
        profile = image.info.get("icc_profile") or b""
        matrix = matrix_profile(profile)
        if profile and matrix is None:
            warnings.append("The colour profile of a 16-bit photo is used only where it is a matrix: taken as sRGB.")
        linear = _srgb(colour) if matrix is None or matrix.is_srgb else matrix.linear(colour, scale + 1)
    else:
        raise InputError(f"{path} holds {pixels.dtype} pixels; save it as 8- or 16-bit RGB.")
    return (linear if alpha is None else _over_white(linear, alpha, warnings)), scene_linear


def _tiff_tag(image: Any, tag: int, usual: int) -> int:
    """The value of a tag of a TIFF, `usual` where it has none or the image is no TIFF."""
    found = (getattr(image, "tag_v2", None) or {}).get(tag, usual)
    return int(found[0] if isinstance(found, tuple) else found)


def _require_interleaved(image: Any, path: Path) -> None:
    """OpenCV reads deep TIFFs whose channels lie apart as if they did not. Raises InputError for those."""
    if _tiff_tag(image, PLANAR, 1) == 2:
        raise InputError(f"{path} has its channels one after the other; save it with interleaved channels.")


def is_float_tiff(path: Path) -> bool:
    """Whether a TIFF holds colour in a layout that Pillow does not know: float channels."""
    from PIL import Image, UnidentifiedImageError

    try:
        with _pixel_limit_lifted(), Image.open(path):
            return False
    except UnidentifiedImageError:
        return True


def read_float_tiff(path: Path, over: float) -> Decoded:
    """Float RGB TIFF, scene-linear, of 16, 32 or 64 bits; OpenCV applies the orientation itself."""
    import cv2
    from tifffile import TiffFile

    with TiffFile(path) as file:
        tags = file.pages[0].tags  # type: ignore[union-attr]
        apart = int(tags.valueof(PLANAR, 1))
        extra = np.atleast_1d(tags.valueof(EXTRA, 2))
        half = _half(file, path) if file.pages[0].dtype == np.float16 else None
    if apart == 2:
        raise InputError(f"{path} has its channels one after the other; save it with interleaved channels.")
    if half is None:
        pixels = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
        order = [2, 1, 0, 3]
    else:
        pixels, order = _upright(half, int(tags.valueof(ORIENTATION, 1))), [0, 1, 2, 3]
    if pixels is None or pixels.ndim != 3 or pixels.shape[2] < 3 or pixels.dtype.kind != "f":
        raise InputError(f"{path} is a damaged TIFF, or one of an unusual layout; save it as 8- or 16-bit RGB.")
    check_size(pixels.shape[1], pixels.shape[0], path)
    colour, laid = np.ascontiguousarray(pixels[..., order[:3]], np.float32), False
    if pixels.shape[2] == 4:
        alpha = np.clip(pixels[..., 3:].astype(np.float32), 0, 1)
        laid = over > 0 and bool(np.any(alpha < 1))
        colour = (colour if extra[0] == 1 else colour * alpha) + np.float32(over) * (1 - alpha)
    return Decoded(colour, True, {}, [OVER_WHITE] * laid, laid)


def _half(file: Any, path: Path) -> Array:
    """Pixels [H, W, C] of 16-bit floats, which OpenCV does not know."""
    try:
        return np.asarray(file.pages[0].asarray())
    except ValueError as error:  # a compression that needs a library of its own
        if "imagecodecs" not in str(error):
            raise
        raise InputError(f"{path} is compressed in an unusual way; save it uncompressed, or with ZIP.") from error


def _srgb(pixels: Array) -> Array:
    """[...] uint8 or uint16 sRGB to float32 linear, by table: exact, and no copy in between."""
    levels = np.iinfo(pixels.dtype).max + 1
    return srgb_to_linear(np.arange(levels, dtype=np.float32) / np.float32(levels - 1))[pixels]


def _over_white(linear: Array, alpha: Array, warnings: list[str]) -> Array:
    """Lay [H, W, 3] with straight [H, W, 1] alpha over white, in linear light."""
    if bool(np.all(alpha >= 1)):
        return linear
    warnings.append(OVER_WHITE)
    return linear * alpha + (1 - alpha)


def _upright(pixels: Array, orientation: int) -> Array:
    """Undo an EXIF orientation (1 .. 8)."""
    turned = {
        2: lambda p: p[:, ::-1],
        3: lambda p: p[::-1, ::-1],
        4: lambda p: p[::-1],
        5: lambda p: p.swapaxes(0, 1),
        6: lambda p: p.swapaxes(0, 1)[:, ::-1],
        7: lambda p: p.swapaxes(0, 1)[::-1, ::-1],
        8: lambda p: p.swapaxes(0, 1)[::-1],
    }
    return np.ascontiguousarray(turned[orientation](pixels)) if orientation in turned else pixels


@contextmanager
def _pixel_limit_lifted() -> Iterator[None]:
    """Let Pillow open files up to our own limit, which `check_size` applies before any pixel is decoded."""
    from PIL import Image

    before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before
