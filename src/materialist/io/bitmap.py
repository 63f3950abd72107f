"""Pictures of integers and float TIFFs, by Pillow and OpenCV, to linear Rec.709."""

import io
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageCms, UnidentifiedImageError

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.exif import image_tags
from materialist.io.icc import MatrixProfile, matrix_profile
from materialist.types import Array

FORMATS = "PNG, JPEG, HEIC, TIFF, WEBP, EXR, HDR or camera RAW"
OVER_WHITE = "Transparent parts are laid over white."
MAX_PIXELS = 200_000_000
"""Largest photo accepted, pixels: the largest phone sensors; 2.4 GB as float32."""
MIN_SIDE = 8
"""Shortest side accepted, pixels."""
MAX_ASPECT = 8
"""Longest shape accepted, long side over short side."""
_PHOTOMETRIC, _PLANAR, _EXTRA = 262, 284, 338
"""Tags of TIFF: what values mean, whether channels lie apart, and what the channel beyond colour is."""
_PREMULTIPLIED = 1
"""Value of `_EXTRA`: alpha that colours are multiplied by."""


@dataclass
class Decoded:
    """A decoded file."""

    linear: Array
    """[H, W, 3] float32 linear Rec.709, upright; display files in [0, 1], scene-linear ones (EXR, HDR) as stored."""
    scene_linear: bool = False
    """True for files that hold light rather than display values: EXR, HDR, float TIFF."""
    tags: dict[str, Any] = field(default_factory=dict)
    """EXIF by name."""
    warnings: list[str] = field(default_factory=list)
    alpha: Array | None = None
    """[H, W, 1] in [0, 1] of a scene-linear file with transparent parts, whose `linear` is the light of the rest."""

    def over(self, radiance: float) -> Array:
        """[H, W, 3] with `radiance` behind what is transparent."""
        return self.linear if self.alpha is None else self.linear + np.float32(radiance) * (1 - self.alpha)


def check_size(width: int, height: int, name: object) -> None:
    """Refuse photos that are too small, too large or too long, before their pixels are decoded."""
    if width * height > MAX_PIXELS:
        raise InputError(
            f"{name} is {width} x {height} = {width * height / 1e6:.0f} megapixels; the limit is "
            f"{MAX_PIXELS / 1e6:.0f}: shrink it first."
        )
    if min(width, height) < MIN_SIDE:
        raise InputError(f"{name} is {width} x {height} pixels; at least {MIN_SIDE} on each side are needed.")
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise InputError(f"{name} is {width} x {height} pixels, longer than {MAX_ASPECT}:1; crop it to what matters.")


def light_and_alpha(light: Array, alpha: Array | None) -> Decoded:
    """A scene-linear file of [H, W, 3] light with [H, W, 1] alpha, which is dropped where it is opaque."""
    if alpha is None or bool(np.all(alpha >= 1)):
        return Decoded(light, True)
    return Decoded(light, True, warnings=[OVER_WHITE], alpha=np.clip(alpha.astype(np.float32), 0, 1))


def read_bitmap(path: Path) -> Decoded:
    """Everything Pillow opens: PNG, JPEG, HEIC, TIFF, WEBP, BMP, GIF, AVIF, ..."""
    # From an open file: Pillow maps files that it is given by name, and gets the rows of turned ones wrong.
    with pixel_limit_lifted(), path.open("rb") as file, Image.open(file) as image:
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
    return image.mode in ("I", "F") or image.mode.startswith("I;16")


def _shallow(image: Image.Image, warnings: list[str]) -> Array:
    """8 bits a channel, any Pillow mode, to [H, W, 3] float32 linear."""
    alpha = None
    if image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info:
        image_rgba = image.convert("RGBA")
        alpha = np.asarray(image_rgba)[..., 3:].astype(np.float32) / 255
        if image.mode not in ("L", "LA", "La"):
            image_rgba.info.update(image.info)
            image = image_rgba
    profile = image.info.get("icc_profile")
    matrix = matrix_profile(profile) if profile else None
    if matrix is not None and image.mode not in ("CMYK", "L", "LA", "1"):
        linear = _by_matrix(np.asarray(image.convert("RGB")), matrix)
    else:
        linear = _srgb(np.asarray(_through_lcms(image, profile if matrix is None else None, warnings)))
    return linear if alpha is None else _over_white(linear, alpha, warnings)


def _through_lcms(image: Image.Image, profile: bytes | None, warnings: list[str]) -> Image.Image:
    """An 8-bit sRGB image, by the embedded profile where there is one that fits, else by Pillow's own conversion."""
    if profile:
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
    tags = getattr(image, "tag_v2", {})
    _require_interleaved(tags.get(_PLANAR, 1), path)
    if tags.get(_PHOTOMETRIC) == 0 or _PREMULTIPLIED in np.atleast_1d(tags.get(_EXTRA, 2)):
        raise InputError(f"{path} has inverted values or premultiplied alpha; save it as plain 16-bit RGB.")
    colour, alpha = _rgb(path)
    if colour.dtype.kind == "f":
        return np.ascontiguousarray(colour, np.float32), True
    profile = image.info.get("icc_profile")
    matrix = matrix_profile(profile) if profile else None
    if profile and matrix is None:
        warnings.append("The colour profile of a 16-bit photo is used only where it is a matrix: taken as sRGB.")
    linear = _by_matrix(colour, matrix)
    if alpha is not None:
        linear = _over_white(linear, alpha / np.float32(np.iinfo(alpha.dtype).max), warnings)
    return linear, False


def stored_pixels(path: Path) -> tuple[Array, Array | None]:
    """RGB [H, W, 3] or grey [H, W, 1], and alpha [H, W, 1], as they are in a file that OpenCV reads.

    They are uint8, uint16, float32 or float64. Raises InputError for other pixels, and for none.
    """
    import cv2

    try:
        decoded = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:  # an empty file, or a header that promises more pixels than any picture has
        decoded = None
    if decoded is None or decoded.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        raise InputError(
            f"{path} is no readable picture: damaged or truncated, too large, or of an unusual layout; export it again "
            "as EXR, or as PNG or TIFF of 8 or 16 bits."
        )
    pixels = np.atleast_3d(decoded)
    colour = pixels[..., :1] if pixels.shape[2] <= 2 else pixels[..., 2::-1]
    return colour, pixels[..., -1:] if pixels.shape[2] in (2, 4) else None


def _rgb(path: Path) -> tuple[Array, Array | None]:
    """`stored_pixels` with grey as RGB."""
    colour, alpha = stored_pixels(path)
    return np.broadcast_to(colour, (*colour.shape[:2], 3)), alpha


def _require_interleaved(planar: int, path: Path) -> None:
    """OpenCV reads deep TIFFs whose channels lie apart as if they did not. Raises InputError for those."""
    if planar == 2:
        raise InputError(f"{path} has its channels one after the other; save it with interleaved channels.")


def is_float_tiff(path: Path) -> bool:
    """Whether a TIFF holds colour in a layout that Pillow does not know: float channels."""
    try:
        with pixel_limit_lifted(), Image.open(path):
            return False
    except UnidentifiedImageError:
        return True


def read_float_tiff(path: Path) -> Decoded:
    """Float RGB TIFF, scene-linear, of 32 or 64 bits; OpenCV applies the orientation itself."""
    from tifffile import TiffFile

    with TiffFile(path) as file:
        page: Any = file.pages[0]
        _require_interleaved(page.tags.valueof(_PLANAR, 1), path)
        extra = np.atleast_1d(page.tags.valueof(_EXTRA, 2))
    colour, alpha = _rgb(path)
    light = np.ascontiguousarray(colour, np.float32)
    if alpha is not None and extra[0] != _PREMULTIPLIED:
        light = light * alpha.astype(np.float32)
    return light_and_alpha(light, alpha)


def _by_matrix(pixels: Array, matrix: MatrixProfile | None) -> Array:
    """Linear values of uint8 or uint16; sRGB's own where there is no profile or it is sRGB's."""
    return _srgb(pixels) if matrix is None or matrix.is_srgb else matrix.linear(pixels)


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
    pixels = pixels.swapaxes(0, 1) if orientation in (5, 6, 7, 8) else pixels
    pixels = pixels[::-1] if orientation in (3, 4, 7, 8) else pixels
    return np.ascontiguousarray(pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels)


@contextmanager
def pixel_limit_lifted() -> Iterator[None]:
    """Let Pillow open files up to our own limit, which `check_size` applies before any pixel is decoded."""
    before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        yield
    finally:
        Image.MAX_IMAGE_PIXELS = before
