"""Pictures of integers and float TIFFs, by Pillow and OpenCV, to linear Rec.709."""

import io
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, ImageCms
from tifffile import TiffFile

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.exif import file_tags, image_tags
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
_LAYOUT = {"BitsPerSample": 8, "PlanarConfiguration": 1, "PhotometricInterpretation": 2, "ExtraSamples": 2}
"""Tags of TIFF, and what they are by themselves: a channel's bits, whether channels lie apart (2), what values mean (0:
white is zero), and what the channel beyond colour is (1: alpha that colours are multiplied by)."""
_LIMIT = threading.RLock()


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

    def exposed(self, stops: int = 0) -> Array:
        """[H, W, 3] times 2**stops, with white behind what is transparent."""
        linear = self.linear * np.float32(2.0**stops) if stops else self.linear
        return linear if self.alpha is None else linear + (1 - self.alpha)


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
    """Everything Pillow opens but deep TIFF: PNG, JPEG, HEIC, TIFF, WEBP, BMP, GIF, AVIF, ..."""
    # From an open file: Pillow maps files that it is given by name, and gets the rows of turned ones wrong.
    with pixel_limit_lifted(), path.open("rb") as file, Image.open(file) as image:
        image.load()  # finds truncation, also for files whose pixels OpenCV reads below
        warnings = _first_of(1 if image.format in ("MPO", "HEIF", "JPEG") else getattr(image, "n_frames", 1))
        tags = image_tags(image)
        file.seek(24)  # where a PNG has its bits a channel; Pillow cuts those of RGB to 8
        if image.mode[0] in "IF" or (image.format == "PNG" and file.read(1) == b"\x10"):
            linear = _deep(*_rgb(path), image.info.get("icc_profile"), warnings)
        else:
            linear = _shallow(image, warnings)
    return Decoded(_upright(linear, int(tags.get("Orientation", 1) or 1)), False, tags, warnings)


def read_tiff(path: Path) -> Decoded:
    """A TIFF: scene-linear where it holds floats. What is deeper than 8 bits OpenCV reads, and turns upright itself."""
    with TiffFile(path) as file:
        page: Any = file.pages[0]
        bits, planar, meaning, extra = (page.tags.valueof(name, usual) for name, usual in _LAYOUT.items())
        profile, warnings = page.tags.valueof("InterColorProfile"), _first_of(len(file.pages))
    if np.max(bits) <= 8:
        return read_bitmap(path)
    if planar == 2:  # OpenCV would read them as if they lay together
        raise InputError(f"{path} has its channels one after the other; save it with interleaved channels.")
    colour, alpha = _rgb(path)
    floats, premultiplied = colour.dtype.kind == "f", 1 in np.atleast_1d(extra)
    if meaning == 0 or (premultiplied and not floats):
        raise InputError(f"{path} has inverted values or premultiplied alpha; save it as plain 16-bit RGB.")
    if not floats:
        return Decoded(_deep(colour, alpha, profile, warnings), False, file_tags(path), warnings)
    light = np.ascontiguousarray(colour, np.float32)
    if alpha is not None and not premultiplied:
        light = light * alpha.astype(np.float32)
    return light_and_alpha(light, alpha)


def _first_of(frames: int) -> list[str]:
    """The warning of a file of several pictures."""
    return [f"The file holds {frames} pictures; the first is used."] if frames > 1 else []


def _shallow(image: Image.Image, warnings: list[str]) -> Array:
    """8 bits a channel, any Pillow mode, to [H, W, 3] float32 linear."""
    alpha, profile = None, image.info.get("icc_profile")
    if image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info:
        image_rgba = image.convert("RGBA")
        alpha = np.asarray(image_rgba)[..., 3:]
        image = image if image.mode in ("L", "LA", "La") else image_rgba
    matrix = matrix_profile(profile) if profile else None
    if matrix is not None and image.mode not in ("CMYK", "L", "LA", "1"):
        return _linear(np.asarray(image.convert("RGB")), alpha, matrix, warnings)
    flat = _through_lcms(image, profile if matrix is None else None, warnings)
    return _linear(np.asarray(flat), alpha, None, warnings)


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


def _deep(colour: Array, alpha: Array | None, profile: bytes | None, warnings: list[str]) -> Array:
    """Integers of 16 bits a channel (or 8) to [H, W, 3] float32 linear."""
    matrix = matrix_profile(profile) if profile else None
    if profile and matrix is None:
        warnings.append("The colour profile of a 16-bit photo is used only where it is a matrix: taken as sRGB.")
    return _linear(colour, alpha, matrix, warnings)


def _linear(colour: Array, alpha: Array | None, matrix: MatrixProfile | None, warnings: list[str]) -> Array:
    """[H, W, 3] float32 linear of levels, by a profile or as sRGB; straight [H, W, 1] alpha is laid over white."""
    linear = srgb_to_linear(colour) if matrix is None or matrix.is_srgb else matrix.linear(colour)
    top = 1 if alpha is None else np.iinfo(alpha.dtype).max
    if alpha is None or alpha.min() == top:
        return linear
    warnings.append(OVER_WHITE)
    share = alpha / np.float32(top)
    return linear * share + (1 - share)


def stored_pixels(path: Path) -> tuple[Array, Array | None]:
    """RGB [H, W, 3] or grey [H, W, 1], and alpha [H, W, 1], as they are in a file that OpenCV reads.

    They are uint8, uint16, float32 or float64. Raises InputError for other pixels, and for none.
    """
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


def _upright(pixels: Array, orientation: int) -> Array:
    """Undo an EXIF orientation (1 .. 8)."""
    pixels = pixels.swapaxes(0, 1) if orientation in (5, 6, 7, 8) else pixels
    pixels = pixels[::-1] if orientation in (3, 4, 7, 8) else pixels
    return np.ascontiguousarray(pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels)


@contextmanager
def pixel_limit_lifted() -> Iterator[None]:
    """Let Pillow open files up to our own limit, which `check_size` applies before any pixel is decoded."""
    with _LIMIT:  # all threads share Pillow's
        before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS = before
