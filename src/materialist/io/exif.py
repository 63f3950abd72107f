"""EXIF tags of a file, and the field of view that they tell (derivation: docs/inputs.md)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

FILM_WIDTH = 36.0
"""Long side of a 35 mm film frame, millimetres."""

_UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
"""Millimetres in a FocalPlaneResolutionUnit: inch, centimetre, millimetre, micrometre."""


def image_tags(image: Image.Image) -> dict[str, Any]:
    """EXIF tags of an image by name; {} where they are damaged."""
    with suppress(Exception):  # damaged EXIF does not make a photo unreadable
        return _named(image.getexif())
    return {}


def file_tags(path: Path) -> dict[str, Any]:
    """EXIF of a RAW file; most are TIFF inside, the others give none."""
    exif = Image.Exif()
    with (
        suppress(Exception),
        path.open("rb") as file,
    ):  # no EXIF is no error: the field of view then falls back
        exif.load_from_fp(file)
        return _named(exif)
    return {}


def horizontal_fov(tags: Mapping[str, Any], width: int, height: int) -> float | None:
    """Horizontal field of view, degrees, of a picture of width x height pixels (already turned upright), or None.

    `tags` are EXIF names and values. FocalLengthIn35mmFilm comes first: the long side of the picture is taken as the
    36 mm of a film frame. Without it, FocalLength with FocalPlaneXResolution gives the focal length in pixels.
    Values that lead outside (1, 170) degrees are not believed.
    """
    film = _number(tags.get("FocalLengthIn35mmFilm"))
    focal = (
        film / FILM_WIDTH * max(width, height) if film else _from_focal_plane(tags, width, height)
    )
    if not focal:
        return None
    # tan(fov / 2) = (width / 2) / focal, in pixels.
    fov = math.degrees(2 * math.atan(0.5 * width / focal))
    return fov if 1 < fov < 170 else None


def _from_focal_plane(tags: Mapping[str, Any], width: int, height: int) -> float | None:
    """Focal length in pixels from the real focal length and the density of pixels on the sensor."""
    focal_mm = _number(tags.get("FocalLength"))
    density = _number(tags.get("FocalPlaneXResolution"))
    unit = _UNIT_MM.get(int(_number(tags.get("FocalPlaneResolutionUnit")) or 2))
    if not (focal_mm and density and unit):
        return None
    # The density belongs to the picture as recorded; one that was scaled since carries the recorded size in EXIF.
    # Long sides are compared because the picture may have been turned upright.
    sides = [_number(tags.get(name)) for name in ("ExifImageWidth", "ExifImageHeight")]
    recorded = max((side for side in sides if side), default=0.0) or max(width, height)
    sensor_mm = recorded / density * unit
    if not 1 < sensor_mm < 100:  # no camera has such a sensor: the tags do not mean what they say
        return None
    return focal_mm * density / unit * max(width, height) / recorded


def _number(value: Any) -> float | None:
    """A positive finite float from an EXIF value (rationals may be 0/0), or None."""
    try:
        number = float(value)
    except (TypeError, ValueError, ZeroDivisionError):
        return None
    return number if math.isfinite(number) and number > 0 else None


def _named(exif: Image.Exif) -> dict[str, Any]:
    """Tags by name, of the main, the Exif and the interoperability directory."""
    tags = {**exif, **exif.get_ifd(ExifTags.IFD.Exif)}
    named = {ExifTags.TAGS[tag]: value for tag, value in tags.items() if tag in ExifTags.TAGS}
    if ExifTags.IFD.Interop in tags:
        named["InteropIndex"] = exif.get_ifd(ExifTags.IFD.Interop).get(1)
    return named
