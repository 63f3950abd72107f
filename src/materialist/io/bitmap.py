"""Pictures of whole levels, by Pillow and OpenCV, to linear Rec.709."""

import io
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image, ImageCms

from materialist.color import ROWS, srgb_to_linear
from materialist.errors import InputError
from materialist.io.boxes import avif_bits, jp2_bits, jp2_profile
from materialist.io.colour_space import ColourSpace
from materialist.io.colour_tags import png_chunks, stated_space
from materialist.io.exif import image_tags
from materialist.io.icc import matrix_profile
from materialist.io.native import unprinted
from materialist.types import Array

FORMATS = "PNG, JPEG, JPEG 2000, HEIC, AVIF, TIFF, WEBP, EXR, HDR or camera RAW"
OVER_WHITE = "Transparent parts are laid over white."
MAX_PIXELS = 200_000_000
"""Largest photo accepted, pixels: the largest phone sensors; 2.4 GB as float32."""
MIN_SIDE = 8
"""Shortest side accepted, pixels."""
MAX_ASPECT = 8
"""Longest shape accepted, long side over short side."""
_PIXEL_SHAPE = 8
"""Widest and narrowest pixel that is believed, width over height."""
_LIMIT = threading.RLock()
_JPEG_END = b"\xff\xd9"
_ENTROPY = (b"\x01", b"\x55", b"\x24", b"\xaa", b"\xd3")
"""Bytes that a JPEG decoder reads as coefficients; after some endings it takes a few of them for damage."""
_PNM = re.compile(rb"P[2356](?:\s+(?:#[^\n]*\n\s*)*(\d+)){3}")
"""Header of a PGM or PPM; its last number is the level that is white."""
_PNM_HEAD = 4096
"""Bytes in which it is looked for."""


@dataclass
class Decoded:
    """A decoded file."""

    linear: Array
    """[H, W, 3] float32 linear Rec.709, upright; display files in [0, 1], scene-linear ones (EXR, HDR) as stored."""
    scene_linear: bool = False
    """True for files that hold light rather than display values: EXR, HDR, float TIFF, PQ and HLG."""
    tags: dict[str, Any] = field(default_factory=dict)
    """EXIF by name."""
    warnings: list[str] = field(default_factory=list)
    alpha: Array | None = None
    """[H, W, 1] in [0, 1] of a scene-linear file with transparent parts, whose `linear` is the light of the rest."""
    layer: str | None = None
    """Which layer of an EXR of several it is."""

    def exposed(self, stops: int = 0) -> Array:
        """[H, W, 3] times 2**stops, with white behind what is transparent."""
        if self.alpha is None and not stops:
            return self.linear
        linear = self.linear * np.float32(2.0**stops)
        if self.alpha is not None:
            linear += 1 - self.alpha
        return linear


def check_size(width: int, height: int, name: object) -> None:
    """Refuse photos that are too small, too large or too long, before their pixels are decoded."""
    if width * height > MAX_PIXELS:
        raise InputError(
            f"{name} is {width} x {height} = {width * height / 1e6:.0f} megapixels; the limit is "
            f"{MAX_PIXELS / 1e6:.0f}: shrink it first."
        )
    if min(width, height) < MIN_SIDE:
        raise InputError(
            f"{name} is {width} x {height} pixels; at least {MIN_SIDE} on each side are needed."
        )
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise InputError(
            f"{name} is {width} x {height} pixels, longer than {MAX_ASPECT}:1; crop it to what matters."
        )


def light_and_alpha(light: Array, alpha: Array | None, notes: list[str]) -> Decoded:
    """A scene-linear file of [H, W, 3] light with [H, W, 1] alpha, which is dropped where it is opaque."""
    if alpha is None or bool(np.all(alpha >= 1)):
        return Decoded(light, True, warnings=notes)
    return Decoded(
        light, True, warnings=[*notes, OVER_WHITE], alpha=np.clip(alpha.astype(np.float32), 0, 1)
    )


def square_pixels(decoded: Decoded, shape: float, path: Path) -> Decoded:
    """A scene-linear picture whose pixels are `shape` times as wide as high, with square ones: stretched, never shrunk.

    A shape that no camera or film has is not believed, with a warning. Raises InputError for what becomes too large.
    """
    if not 1 / _PIXEL_SHAPE <= shape <= _PIXEL_SHAPE:
        decoded.warnings.append(
            f"The file states pixels of {shape:g}:1, which are taken as square."
        )
        return decoded
    if abs(shape - 1) < 1e-3:
        return decoded
    # Only stretched: no pixel of the file is lost.
    height, width = decoded.linear.shape[:2]
    size = (round(width * max(shape, 1)), round(height * max(1 / shape, 1)))
    check_size(*size, path)
    decoded.linear = np.asarray(cv2.resize(decoded.linear, size, interpolation=cv2.INTER_LINEAR))
    if decoded.alpha is not None:
        decoded.alpha = cv2.resize(decoded.alpha, size, interpolation=cv2.INTER_LINEAR)[..., None]
    decoded.warnings.append(
        f"The file's pixels are {shape:.4g}:1; the photo is stretched to square ones."
    )
    return decoded


def read_bitmap(path: Path) -> Decoded:
    """Everything Pillow opens but deep TIFF: PNG, JPEG, HEIC, TIFF, WEBP, BMP, GIF, AVIF, ..."""
    # From an open file: Pillow maps files that it is given by name, and gets the rows of turned ones wrong.
    with pixel_limit_lifted(), path.open("rb") as file, Image.open(file) as opened:
        notes = list[str]()
        # Finds truncation, also for files whose pixels OpenCV reads below.
        image = loaded(opened, path, notes)
        one_picture = image.format in ("MPO", "HEIF", "JPEG")
        warnings = notes + frames_note(1 if one_picture else getattr(image, "n_frames", 1))
        tags = image_tags(image)
        chunks = png_chunks(path) if image.format == "PNG" else {}
        profile = None if b"cICP" in chunks else _profile(image, path)
        # --- What the levels mean: cICP before ICC before other tags ---
        space = None if profile else stated_space(path, image.format, tags, warnings)
        bits = _bits(path, image, chunks)
        if bits > 8 and image.format == "AVIF" and not cv2.haveImageReader(str(path)):
            warnings.append(
                f"Of the AVIF's {bits} bits a channel 8 are read; OpenCV from 4.12 on reads all."
            )
            bits = 8
        if bits > 8 or image.mode[0] in "IF":
            image.close()
            levels = (
                *_deep_levels(path, image.format, bits, chunks.get(b"tRNS")),
                deep_space(profile, warnings) if profile else space,
            )
        else:
            levels = _shallow(image, profile, space, warnings)
    # --- Linear, upright, over white ---
    colour, alpha, space = levels
    if colour.dtype.kind == "f":  # of a PFM: light
        return light_and_alpha(turned_upright(colour, tags).astype(np.float32), None, warnings)
    decoded = flattened(
        turned_upright(colour, tags),
        None if alpha is None else turned_upright(alpha, tags),
        space,
        warnings,
    )
    decoded.tags = tags
    return decoded


def loaded(image: Image.Image, path: Path, notes: list[str]) -> Image.Image:
    """An open image with its pixels; of a JPEG whose end marker alone is missing, too, with a note.

    Pillow turns a TIFF upright here, and takes the orientation from its tags. Raises OSError for a truncated file.
    """
    try:
        image.load()
    except OSError:
        content = _with_end(path) if image.format in ("JPEG", "MPO") else None
        if content is None:
            raise
        image = Image.open(io.BytesIO(content))
        image.load()
        notes.append("The end marker of the JPEG is missing; all its pixels are there.")
    return image


def _with_end(path: Path) -> bytes | None:
    """A JPEG of which the end marker alone is missing, with it; None where pixels are missing, too.

    A decoder that has all pixels skips what follows; one that has not takes it for pixels.
    """
    content = path.read_bytes()
    with Image.open(io.BytesIO(content + _JPEG_END)) as image:
        picture = np.asarray(image)
    for byte in _ENTROPY:
        with Image.open(io.BytesIO(content + 64 * byte + _JPEG_END)) as image:
            if not np.array_equal(picture, np.asarray(image)):
                return None
    return content + _JPEG_END


def frames_note(frames: int) -> list[str]:
    """The warning of a file of several pictures."""
    return [f"The file holds {frames} pictures; the first is used."] if frames > 1 else []


def flattened(
    colour: Array, alpha: Array | None, space: ColourSpace | None, warnings: list[str]
) -> Decoded:
    """Levels [H, W, 3] and straight alpha [H, W, 1], linear by a space or as sRGB, over white where transparent.

    `warnings` become those of the result, and grow.
    """
    linear = srgb_to_linear(colour) if space is None or space.is_srgb else space.linear(colour)
    is_light = space is not None and space.is_light
    top = 1 if alpha is None else np.iinfo(alpha.dtype).max
    if alpha is None or alpha.min() == top:
        return Decoded(linear, is_light, warnings=warnings)
    warnings.append(OVER_WHITE)
    for start in range(0, len(linear), ROWS):  # bounds the memory
        # In linear light, as a transparent film over white paper.
        share = alpha[start : start + ROWS] / np.float32(top)
        linear[start : start + ROWS] *= share
        if not is_light:
            linear[start : start + ROWS] += 1 - share
    return Decoded(
        linear, is_light, warnings=warnings, alpha=alpha / np.float32(top) if is_light else None
    )


def deep_space(profile: bytes, warnings: list[str]) -> ColourSpace | None:
    """The space of a profile for more than 8 bits a channel; a table profile is told of and not used."""
    space = matrix_profile(profile)
    if space is None:
        warnings.append(
            "The colour profile of a photo of more than 8 bits is used only where it is a matrix: taken as sRGB."
        )
    return space


def _profile(image: Image.Image, path: Path) -> bytes | None:
    """The ICC profile of an open image."""
    embedded = image.info.get("icc_profile")
    return jp2_profile(path) if embedded is None and image.format == "JPEG2000" else embedded


Levels = tuple[Array, Array | None, ColourSpace | None]
"""[H, W, 3] whole levels, straight alpha [H, W, 1] of the same type, and what they mean."""


def _shallow(
    image: Image.Image, profile: bytes | None, space: ColourSpace | None, warnings: list[str]
) -> Levels:
    """8 bits a channel, any Pillow mode."""
    alpha = None
    if image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info:
        image_rgba = image.convert("RGBA")
        alpha = np.asarray(image_rgba)[..., 3:]
        image = image if image.mode in ("L", "LA", "La") else image_rgba
    # Matrix profiles are applied in floats; table profiles need LittleCMS, at 8 bits.
    matrix = matrix_profile(profile) if profile and image.mode != "CMYK" else None
    if matrix is None:
        image = _through_lcms(image, profile, warnings)
    return (
        np.asarray(image if image.mode == "RGB" else image.convert("RGB")),
        alpha,
        matrix or space,
    )


def _through_lcms(image: Image.Image, profile: bytes | None, warnings: list[str]) -> Image.Image:
    """An 8-bit sRGB image, by the embedded profile where there is one that fits, else by Pillow's own conversion."""
    if profile:
        try:
            source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
            base = {"GRAY": "L", "RGB ": "RGB", "CMYK": "CMYK"}[source.profile.xcolor_space]
            flat = image if image.mode == base else image.convert(base)
            return ImageCms.profileToProfile(
                flat, source, ImageCms.createProfile("sRGB"), outputMode="RGB"
            )  # type: ignore[return-value]
        except (ImageCms.PyCMSError, KeyError, OSError, ValueError):
            warnings.append(
                "The embedded colour profile cannot be used; the photo is taken as sRGB."
            )
    if image.mode == "CMYK":
        warnings.append("CMYK without a usable profile: colours are approximate.")
    return image


def _bits(path: Path, image: Image.Image, chunks: dict[bytes, bytes]) -> int:
    """Bits a channel of an open image, by its header: Pillow cuts most of what has more than 8 to 8."""
    if image.format == "PNG":
        return chunks.get(b"IHDR", b"\x08" * 9)[8]
    if image.format == "HEIF":
        return int(image.info.get("bit_depth", 8))
    if image.format == "AVIF":
        return avif_bits(path)
    if image.format == "JPEG2000":
        return jp2_bits(path)
    if image.format == "PPM":
        with path.open("rb") as file:
            header = _PNM.match(file.read(_PNM_HEAD))
        return 16 if header is not None and int(header[1]) > 255 else 8
    return 8


def _deep_levels(
    path: Path, kind: str | None, bits: int, transparent: bytes | None
) -> tuple[Array, Array | None]:
    """RGB and alpha of a file of more than 8 bits a channel, of 16 bits.

    `transparent` is the colour that a PNG's tRNS chunk names.
    """
    if kind == "HEIF":
        return _heif_levels(path, bits)
    colour, alpha = rgb_levels(path)
    if kind in ("AVIF", "JPEG2000"):  # which OpenCV gives at their own bits
        return _stretched(colour, bits), None if alpha is None else _stretched(alpha, bits)
    if transparent is None or colour.dtype != np.uint16 or len(transparent) not in (2, 6):
        return colour, alpha
    # Exactly this colour is transparent, and nothing else.
    clear = (colour == np.frombuffer(transparent, ">u2")).all(-1, keepdims=True)
    return colour, np.where(clear, np.uint16(0), np.uint16(65535))


def _stretched(levels: Array, bits: int) -> Array:
    """Levels of 9 to 16 bits as levels of 16: white becomes 65535."""
    high = levels << (16 - bits)
    return high | high >> bits if bits < 16 else levels


def _heif_levels(path: Path, bits: int) -> tuple[Array, Array | None]:
    """RGB and alpha of a HEIC of more than 8 bits a channel, stretched to 16. Raises InputError for odd alpha."""
    from pillow_heif import open_heif

    heif: Any = open_heif(path, convert_hdr_to_8bit=False)
    if heif.premultiplied_alpha:
        raise InputError(
            f"{path} has premultiplied alpha at {bits} bits; save it as plain 16-bit PNG."
        )
    pixels = np.atleast_3d(np.asarray(heif))
    pixels = pixels | pixels >> bits  # white is 65535
    colour = pixels[..., :3] if pixels.shape[2] > 2 else np.repeat(pixels[..., :1], 3, -1)
    return colour, pixels[..., -1:] if heif.has_alpha else None


def stored_pixels(path: Path) -> tuple[Array, Array | None]:
    """RGB [H, W, 3] or grey [H, W, 1], and alpha [H, W, 1], as they are in a file that OpenCV reads.

    They are uint8, uint16, float32 or float64. Raises InputError for other pixels, and for none.
    """
    return levels_of(np.fromfile(path, np.uint8), path)


def levels_of(content: Array, path: Path) -> tuple[Array, Array | None]:
    """`stored_pixels` of the bytes of a file, which messages call `path`."""
    try:
        with unprinted():
            decoded = cv2.imdecode(content, cv2.IMREAD_UNCHANGED)
    except cv2.error:  # an empty file, or a header that promises more pixels than any picture has
        decoded = None
    if decoded is None or decoded.dtype not in (np.uint8, np.uint16, np.float32, np.float64):
        raise InputError(
            f"{path} is no readable picture: damaged or truncated, too large, or of an unusual layout; export it again "
            "as EXR, or as PNG or TIFF of 8 or 16 bits."
        )
    pixels = _whitened(np.atleast_3d(decoded), content)
    colour = pixels[..., :1] if pixels.shape[2] <= 2 else pixels[..., 2::-1]
    return colour, pixels[..., -1:] if pixels.shape[2] in (2, 4) else None


def _whitened(pixels: Array, content: Array) -> Array:
    """Levels of a PGM or PPM, which OpenCV leaves as stored, so that its white is the largest; others as they are."""
    header = _PNM.match(content[:_PNM_HEAD].tobytes())
    if header is None or pixels.dtype.kind != "u":
        return pixels
    white = int(header[1])
    top = np.iinfo(pixels.dtype).max
    if not 0 < white < top:
        return pixels
    scaled = np.round(np.minimum(pixels, white) * np.float32(top / white))
    return np.asarray(scaled, pixels.dtype)


def rgb_levels(path: Path) -> tuple[Array, Array | None]:
    """`stored_pixels` with grey as RGB."""
    colour, alpha = stored_pixels(path)
    return np.broadcast_to(colour, (*colour.shape[:2], 3)), alpha


def turned_upright(pixels: Array, tags: dict[str, Any]) -> Array:
    """Undo the orientation (1 .. 8) that EXIF states."""
    orientation = int(tags.get("Orientation", 1) or 1)
    pixels = pixels.swapaxes(0, 1) if orientation in (5, 6, 7, 8) else pixels
    pixels = pixels[::-1] if orientation in (3, 4, 7, 8) else pixels
    return np.ascontiguousarray(pixels[:, ::-1] if orientation in (2, 3, 6, 7) else pixels)


@contextmanager
def pixel_limit_lifted() -> Iterator[None]:
    """Let Pillow open files up to our own limit, which `check_size` applies before any pixel is decoded."""
    with _LIMIT:  # all threads share Pillow's
        # A global of Pillow's: it must come back whatever happens.
        before = Image.MAX_IMAGE_PIXELS
        Image.MAX_IMAGE_PIXELS = None
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS = before
