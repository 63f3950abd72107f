"""TIFF of more than 8 bits a channel, by OpenCV and tifffile, to linear Rec.709."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import UnidentifiedImageError
from tifffile import TiffFile

from materialist.color import ROWS
from materialist.errors import InputError
from materialist.io.bitmap import (
    Decoded,
    deep_space,
    flattened,
    frames_note,
    light_and_alpha,
    read_bitmap,
    rgb_levels,
    turned_upright,
)
from materialist.io.colour_space import ColourSpace, lab_to_rec709
from materialist.io.colour_tags import exif_space
from materialist.io.exif import file_tags
from materialist.io.icc import matrix_profile
from materialist.io.native import unprinted
from materialist.types import Array

_UNSPECIFIED = 0
_PREMULTIPLIED = 1
"""What the channel beyond colour may be, of ExtraSamples."""
_INVERTED = 0
_GREY = 1
_RGB = 2
_CIELAB = 8
_ICCLAB = 9
"""What values mean, of PhotometricInterpretation."""
_OWN = ("NONE", "ADOBE_DEFLATE", "DEFLATE", "LZMA")
"""Compressions that tifffile decodes without other packages."""
_OF_FLOATS = 3
"""The predictor of floating-point numbers."""
_OPENCV = ("uint16", "float32", "float64")
"""Kinds of numbers deeper than 8 bits that OpenCV reads."""
FOURTH = "The file says of its last channel that it is no transparency; it is left out."


_PRIMARY_TAGS = ("PrimaryChromaticities", "WhitePoint")


@dataclass(frozen=True)
class _Layout:
    """What the tags of the first page say."""

    bits: int
    planar: int
    meaning: int
    extra: tuple[int, ...]
    compression: str
    profile: bytes | None
    frames: int
    samples: int
    """Channels of a pixel."""
    numbers: str
    """What NumPy calls their kind."""
    predictor: int
    """How values are stored as differences to their neighbours; 1 is not at all."""

    @property
    def for_tifffile(self) -> bool:
        """Whether OpenCV would read it wrong, or not at all."""
        opencv_reads = self.numbers in _OPENCV and self.samples in (1, 3, 4)
        return (
            not opencv_reads
            or self.planar == 2
            or self.meaning == _INVERTED
            or self.compression == "LZMA"
        )

    @property
    def is_readable(self) -> bool:
        """Whether one of the two readers knows it; of grey and RGB."""
        numbers = np.dtype(self.numbers) if self.numbers in np.sctypeDict else np.dtype(complex)
        known = numbers.kind in ("u" if self.meaning == _INVERTED else "uf")
        # Without its compiled codecs tifffile knows neither packed levels nor the predictor of floats.
        known &= self.bits == 8 * numbers.itemsize and self.predictor != _OF_FLOATS
        return not self.for_tifffile or (known and self.compression in _OWN)

    @classmethod
    def of(cls, page: Any, frames: int) -> "_Layout":
        tags = page.tags
        extra = tuple(int(kind) for kind in np.atleast_1d(tags.valueof("ExtraSamples", 2)))
        return cls(
            int(np.max(tags.valueof("BitsPerSample", 8))),
            int(tags.valueof("PlanarConfiguration", 1)),
            int(tags.valueof("PhotometricInterpretation", _RGB)),
            extra,
            page.compression.name,
            tags.valueof("InterColorProfile"),
            frames,
            int(tags.valueof("SamplesPerPixel", 1)),
            str(page.dtype),
            int(tags.valueof("Predictor", 1)),
        )


def read_tiff(path: Path) -> Decoded:
    """A TIFF: scene-linear where it holds floats. What is deeper than 8 bits OpenCV reads, and tifffile the rest.

    Raises InputError for layouts that would be read wrong.
    """
    with unprinted(), TiffFile(path) as file:
        # --- Which reader: CIELAB, up to 8 bits, or deep pixels ---
        page: Any = file.pages[0]
        layout = _Layout.of(page, len(file.pages))
        if layout.bits > 8 and layout.meaning in (_CIELAB, _ICCLAB):
            return _lab(page, layout, path)
        if layout.bits <= 8 and layout.numbers != "int8":
            return _shallow(path, layout)
        _require_known(layout, path)
        tags = file_tags(path)
        colour, alpha = _deep_pixels(page, layout, path)
    warnings = frames_note(layout.frames)
    if layout.extra[0] == _UNSPECIFIED:
        warnings.append(FOURTH)
        alpha = None
    # --- Light for floats, display values for whole numbers ---
    space = _space(layout, tags, warnings, is_float=colour.dtype.kind == "f")
    premultiplied = _PREMULTIPLIED in layout.extra
    if colour.dtype.kind == "f":
        decoded = _light(colour, alpha, space, premultiplied, warnings)
    elif alpha is not None and premultiplied:
        raise InputError(f"{path} has premultiplied alpha; save it as plain 16-bit RGB.")
    else:
        decoded = flattened(colour, alpha, space, warnings)
    decoded.tags = tags
    return decoded


def deep_levels(path: Path) -> Array:
    """[H, W, 3] uint16 levels of a grey or RGB TIFF of 16 or 32 bits, upright. Raises InputError for other layouts."""
    with unprinted(), TiffFile(path) as file:
        page: Any = file.pages[0]
        layout = _Layout.of(page, len(file.pages))
        _require_known(layout, path)
        return _deep_pixels(page, layout, path)[0]


def _deep_pixels(page: Any, layout: _Layout, path: Path) -> tuple[Array, Array | None]:
    """RGB [H, W, 3] and alpha [H, W, 1] or None, upright, by the reader that knows the layout."""
    return _levels(page, layout, file_tags(path)) if layout.for_tifffile else rgb_levels(path)


def _shallow(path: Path, layout: _Layout) -> Decoded:
    try:
        decoded = read_bitmap(path)
    except UnidentifiedImageError as error:
        raise InputError(
            f"{path} is a TIFF of {layout.samples} channels of {layout.bits} bits in a layout that is not read; save "
            "it as plain RGB of 8 or 16 bits."
        ) from error
    # --- Transparency: only where the file says that the last channel is one ---
    if layout.extra[0] == _UNSPECIFIED:
        decoded.warnings.append(FOURTH)
    return decoded


def _require_known(layout: _Layout, path: Path) -> None:
    """Refuse what neither OpenCV nor tifffile reads right."""
    if layout.meaning not in (_GREY, _RGB, _INVERTED):
        raise InputError(
            f"{path} is neither grey nor RGB (its PhotometricInterpretation is {layout.meaning}) at {layout.bits} "
            "bits; save it as RGB."
        )
    if not layout.is_readable:
        order = " in planes" * (layout.planar == 2) + ", inverted" * (layout.meaning == _INVERTED)
        order += f" of {layout.bits} bits" * (layout.bits % 8 != 0 or layout.bits == 24)
        order += " with the predictor of floats" * (layout.predictor == _OF_FLOATS)
        raise InputError(
            f"{path} is a TIFF of {layout.samples} channels of {layout.numbers}{order} with compression "
            f"{layout.compression}, which is not read; save it as plain 16-bit RGB."
        )


def _levels(page: Any, layout: _Layout, tags: dict[str, Any]) -> tuple[Array, Array | None]:
    """RGB [H, W, 3] and alpha [H, W, 1] or None as tifffile reads them, upright: uint16 or float32."""
    pixels = np.atleast_3d(page.asarray())
    if layout.planar == 2 and layout.samples > 1:
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype.kind == "u":
        pixels = (pixels >> (8 * pixels.dtype.itemsize - 16)).astype(np.uint16)
        pixels = 65535 - pixels if layout.meaning == _INVERTED else pixels
    pixels = turned_upright(
        pixels.astype(np.float32 if pixels.dtype.kind == "f" else np.uint16), tags
    )
    colours = 1 if layout.samples < 3 else 3
    alpha = pixels[..., colours : colours + 1] if layout.samples > colours else None
    return np.broadcast_to(pixels[..., :colours], (*pixels.shape[:2], 3)), alpha


def _space(
    layout: _Layout, tags: dict[str, Any], warnings: list[str], *, is_float: bool
) -> ColourSpace | None:
    """What the values mean; None for sRGB, and for floats that are linear Rec.709."""
    if layout.profile is None:
        if not is_float:
            return exif_space(tags, warnings)
        # Floats are light: of what tags say only the primaries count.
        stated = {name: tags[name] for name in _PRIMARY_TAGS if name in tags}
        return exif_space({**stated, "Gamma": 1}, warnings)
    if not is_float:
        return deep_space(layout.profile, warnings)
    space = matrix_profile(layout.profile)
    if space is None:
        warnings.append(
            "The colour profile of a float TIFF is used only where it is a matrix: taken as linear."
        )
    return space


def _light(
    colour: Array,
    alpha: Array | None,
    space: ColourSpace | None,
    premultiplied: bool,
    warnings: list[str],
) -> Decoded:
    """A float TIFF: light, by its profile or as it is."""
    light = np.array(colour, np.float32, order="C") if space is None else space.linear(colour)
    if alpha is not None and not premultiplied:
        light *= alpha.astype(np.float32)
    return light_and_alpha(light, alpha, warnings)


def _lab(page: Any, layout: _Layout, path: Path) -> Decoded:
    """CIELab of 16 bits: signed a and b (TIFF 6), or with 128 added to them (ICC). Raises InputError."""
    if layout.compression not in ("NONE", "ADOBE_DEFLATE", "DEFLATE") or layout.bits != 16:
        raise InputError(
            f"{path} holds CIELab of {layout.bits} bits, compressed by {layout.compression}; save it uncompressed at "
            "16 bits, or as RGB."
        )
    # tifffile decodes without colour conversion, which OpenCV would do wrong for deep CIELab.
    stored = page.asarray()
    if stored.ndim != 3 or stored.shape[-1] != 3:
        raise InputError(
            f"{path} holds CIELab of another shape than three channels; save it as RGB."
        )
    linear: Array = np.empty(stored.shape, np.float32)
    for start in range(0, len(stored), ROWS):  # bounds the memory
        rows = slice(start, start + ROWS)
        linear[rows] = lab_to_rec709(_lab_values(stored[rows], layout.meaning))
    tags = file_tags(path)
    return Decoded(turned_upright(linear, tags), False, tags, frames_note(layout.frames))


def _lab_values(stored: Array, meaning: int) -> Array:
    """CIELab of levels of 16 bits: L in [0, 100], a and b around 0."""
    if meaning == _CIELAB:
        signed = stored[..., 1:].astype(np.int16)
        return np.concatenate([stored[..., :1] * (100 / 65535), signed / 256], -1)
    return stored * np.array([100 / 65280, 1 / 256, 1 / 256]) - np.array([0, 128, 128])
