"""The colours that a photo's file has: pictures made of it are written in them, so that none are clipped to sRGB."""

import io
import tempfile
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from PIL import Image
from tifffile import TiffFile

from materialist.color import ROWS, srgb_levels
from materialist.io.bitmap import loaded, pixel_limit_lifted, rgb_levels, turned_upright
from materialist.io.boxes import jp2_profile
from materialist.io.colour_space import ColourSpace, transformed
from materialist.io.colour_tags import png_chunks, stated_space
from materialist.io.decode import RAW_SUFFIXES
from materialist.io.exif import image_tags
from materialist.io.icc import matrix_profile
from materialist.io.out.depth import is_deep, is_tiff
from materialist.io.out.icc import profile_of, srgb_profile
from materialist.io.tiff import deep_levels
from materialist.types import Array, Photo

UNKEPT = "The photo's colours are of a kind that is not written ({}); the picture is sRGB."
CLIPPED = (
    "Colours beyond sRGB are clipped, as of all transparent photos and of HEIC of more than 8 bits."
)
_TOLERANCE = 1e-6
"""Linear difference up to which a pixel is the photo's: far less than a level of 16 bits but in the darkest."""
_GREY_AND_RGB = (0, 1, 2)
"""PhotometricInterpretation of TIFF."""
_MOVED = 0.25
"""Share of what clipping took by which a channel is well above 0 (by eye)."""


@dataclass(frozen=True)
class PhotoColours:
    """How linear Rec.709 becomes levels of a file."""

    profile: bytes
    """The ICC profile that says what the levels mean."""
    space: ColourSpace | None = None
    """None: sRGB."""
    stored: Array | None = None
    """[H0, W0, 3] uint8 or uint16: the levels of the photo's own file, upright; None where they are sRGB or unknown."""
    notes: tuple[str, ...] = ()

    def levels(self, picture: Array, dtype: type) -> Array:
        """[H, W, 3] levels of a picture [H, W, 3] linear Rec.709; the photo's own pixels get their own levels back."""
        if self.space is None:
            return srgb_levels(picture, dtype)
        thresholds = _thresholds(self.space, dtype)
        # --- Linear Rec.709 back to the photo's primaries, then each channel by its thresholds ---
        inverse = np.linalg.inv(self.space.matrix).T.astype(np.float32)
        out: Array = np.empty(picture.shape, dtype)
        for start in range(0, len(picture), ROWS):  # bounds the memory
            rows = slice(start, start + ROWS)
            here = np.nan_to_num(picture[rows])
            kept, whole = self._of_the_photo(rows, here, picture.shape)
            values = whole @ inverse
            for channel, steps in enumerate(thresholds):
                out[rows, :, channel] = np.searchsorted(steps, values[..., channel], side="right")
            if self.stored is not None and self.stored.dtype == dtype:
                out[rows][kept] = self.stored[rows][kept]
        return out

    def whole(self, picture: Array) -> Array:
        """[H, W, 3] linear Rec.709 with the colours outside of it that the photo has: below 0 or above 1."""
        if self.space is None or self.stored is None or self.stored.shape != picture.shape:
            return picture
        out = picture.copy()
        for start in range(0, len(picture), ROWS):
            rows = slice(start, start + ROWS)
            out[rows] = self._of_the_photo(rows, picture[rows], picture.shape)[1]
        return out

    @cached_property
    def _tables(self) -> list[Array]:
        """Each channel's linear value, by its stored level."""
        if self.space is None or self.stored is None:
            return []
        top = np.iinfo(self.stored.dtype).max
        return [curve(np.arange(top + 1) / top).astype(np.float32) for curve in self.space.curves]

    def _of_the_photo(
        self, rows: slice, picture: Array, shape: tuple[int, ...]
    ) -> tuple[Array, Array]:
        """(which pixels [h, W] are the photo's, [h, W, 3] those rows with what clipping took from the photo).

        A pixel that an edit made darker has less of it, by its most darkened channel. A channel that was below 0 and is
        well above it now is one of a new colour, and has none.
        """
        if self.space is None or self.stored is None or self.stored.shape != shape:
            return np.zeros(picture.shape[:2], bool), picture
        # --- What clipping to Rec.709 took from the photo ---
        unclipped = np.stack(
            [table[self.stored[rows][..., k]] for k, table in enumerate(self._tables)], -1
        )
        transformed(unclipped, self.space.matrix)
        inside = np.clip(unclipped, 0, 1)
        lost = unclipped - inside
        kept = (np.abs(picture - inside) <= _TOLERANCE).all(-1)
        if not lost.any():
            return kept, picture
        # --- How much of it an edited pixel keeps ---
        share = np.clip((picture + _TOLERANCE) / (inside + _TOLERANCE), 0, 1).min(-1, keepdims=True)
        share[kept] = 1
        at_end = np.clip(1 - picture / np.maximum(-_MOVED * lost, _TOLERANCE), 0, 1)
        at_end[lost > 0] = 1
        return kept, np.where(lost != 0, picture + share * at_end * lost, picture).astype(
            np.float32
        )


SRGB = PhotoColours(srgb_profile())


def photo_colours(photo: Photo) -> PhotoColours:
    """Those of the photo's file; sRGB for what has none, holds light, or came from memory."""
    suffix = Path(photo.path or "").suffix.lower()
    if photo.source is None or photo.hdr or suffix in RAW_SUFFIXES:
        return SRGB
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"photo{suffix}"
        file.write_bytes(photo.source)
        try:
            return _of_file(file, deep=is_deep(photo))
        except (OSError, ValueError):  # what Pillow does not know: EXR, and TIFFs of some layouts
            return _of_odd_tiff(photo.source) if is_tiff(photo.source) else SRGB


def _of_file(file: Path, *, deep: bool) -> PhotoColours:
    from pillow_heif import register_heif_opener

    register_heif_opener()
    with pixel_limit_lifted(), file.open("rb") as opened, Image.open(opened) as image:
        # --- What the file says of its colours ---
        tags = image_tags(image)
        kind = image.format
        mode = image.mode
        chunks = png_chunks(file) if kind == "PNG" else {}
        embedded = jp2_profile(file) if kind == "JPEG2000" else image.info.get("icc_profile")
        profile = None if b"cICP" in chunks else embedded
        colours = matrix_profile(profile) if profile else stated_space(file, kind, tags, [])
        # --- Kinds that are written as sRGB, or without the stored levels ---
        if mode in ("L", "LA", "1", "I;16") or (colours is None and not profile and mode != "CMYK"):
            return SRGB
        if colours is None or mode == "CMYK" or colours.is_light:
            return PhotoColours(SRGB.profile, notes=(UNKEPT.format(_reason(mode, profile)),))
        written_profile = profile if profile and profile[16:20] == b"RGB " else profile_of(colours)
        if colours.is_srgb:
            return PhotoColours(written_profile if profile else SRGB.profile)
        if "A" in mode or "a" in mode or "transparency" in image.info or (kind == "HEIF" and deep):
            return PhotoColours(written_profile, colours, notes=(CLIPPED,))
        if not deep:
            whole = loaded(image, file, [])
            stored = turned_upright(np.asarray(whole.convert("RGB")), image_tags(whole))
            return PhotoColours(written_profile, colours, stored)
    is_a_tiff = is_tiff(file.read_bytes())
    levels = deep_levels(file) if is_a_tiff else turned_upright(rgb_levels(file)[0], tags)
    return PhotoColours(written_profile, colours, levels)


def _of_odd_tiff(content: bytes) -> PhotoColours:
    """sRGB, with a note where a TIFF that Pillow does not open has other colours."""
    page = TiffFile(io.BytesIO(content)).pages.first
    profile = page.tags.valueof("InterColorProfile")
    colours = matrix_profile(profile) if profile else None
    is_srgb = profile is None if colours is None else colours.is_srgb
    if is_srgb and page.photometric in _GREY_AND_RGB:
        return SRGB
    return PhotoColours(SRGB.profile, notes=(UNKEPT.format("a TIFF of a rare layout"),))


def _reason(mode: str, profile: bytes | None) -> str:
    if mode == "CMYK":
        return "CMYK"
    return "a profile of tables" if profile else "HDR"


def _thresholds(colours: ColourSpace, dtype: type) -> list[Array]:
    """Each channel's linear values from which the next level begins: rounding to levels of the encoded value."""
    top = np.iinfo(dtype).max
    halves = (np.arange(top) + 0.5) / top
    return [np.maximum.accumulate(curve(halves)).astype(np.float32) for curve in colours.curves]
