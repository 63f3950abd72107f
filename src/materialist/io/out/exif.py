"""EXIF for a picture that was made of a photo: what the photo's says, upright, and by which program."""

import io
from contextlib import suppress
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image

from materialist import __version__
from materialist.io.bitmap import pixel_limit_lifted
from materialist.io.decode import RAW_SUFFIXES
from materialist.io.out.depth import is_tiff
from materialist.types import Photo

_KEPT = (
    "ImageDescription",
    "Make",
    "Model",
    "DateTime",
    "Artist",
    "Copyright",
    "HostComputer",
    "Rating",
    "XResolution",
    "YResolution",
    "ResolutionUnit",
    "XPTitle",
    "XPComment",
    "XPAuthor",
    "XPKeywords",
    "XPSubject",
)
"""Tags of the main directory that are of the photograph and not of how its file lays out pixels."""
_NUMBER = {name: number for number, name in ExifTags.TAGS.items()}
_SIDES = (_NUMBER["ExifImageWidth"], _NUMBER["ExifImageHeight"])
_TURNED = (5, 6, 7, 8)
"""Orientations whose upright picture has the file's sides exchanged."""
_ATTRIBUTES: dict[str, tuple[str, type]] = {
    "Make": ("cameraMake", str),
    "Model": ("cameraModel", str),
    "LensModel": ("lensModel", str),
    "DateTimeOriginal": ("capDate", str),
    "Artist": ("owner", str),
    "ImageDescription": ("comments", str),
    "ExposureTime": ("expTime", float),
    "FNumber": ("aperture", float),
    "ISOSpeedRatings": ("isoSpeed", float),
    "FocalLength": ("nominalFocalLength", float),
}
"""EXIF -> the standard attribute of OpenEXR of the same meaning and unit."""
SOFTWARE = f"Materialist {__version__}"


def copied_exif(photo: Photo | None, *, srgb: bool = True) -> Image.Exif:
    """The EXIF of the photo's file for an upright picture, `srgb` or in the photo's own colours.

    The camera, the lens, dates and the place are kept; a preview and the layout of the file are not.
    """
    # --- Copied tag by tag: a preview or the layout of the old file would be wrong ---
    old = _of_file(photo)
    new = Image.Exif()
    for name in _KEPT:
        if _NUMBER[name] in old:
            new[_NUMBER[name]] = old[_NUMBER[name]]
    # --- The picture is upright, so that width and height may change places ---
    turned = old.get(ExifTags.Base.Orientation) in _TURNED
    taken = dict(_directory(old, ExifTags.IFD.Exif))
    place = dict(_directory(old, ExifTags.IFD.GPSInfo))
    taken.pop(ExifTags.IFD.Interop, None)
    if turned and all(side in taken for side in _SIDES):
        width, height = _SIDES
        taken[width], taken[height] = taken[height], taken[width]
    if taken:
        # 65535: not sRGB; the profile says which.
        taken[ExifTags.Base.ColorSpace] = 1 if srgb else 65535
        new.get_ifd(ExifTags.IFD.Exif).update(taken)
    if place:
        new.get_ifd(ExifTags.IFD.GPSInfo).update(place)
    new[ExifTags.Base.Orientation] = 1
    new[ExifTags.Base.Software] = SOFTWARE
    return new


def exr_attributes(photo: Photo | None) -> dict[str, str | float]:
    """What the photo's EXIF says, as the standard attributes of an EXR; those that it lacks are absent."""
    exif = copied_exif(photo)
    values = {**exif, **_directory(exif, ExifTags.IFD.Exif)}
    attributes: dict[str, str | float] = {}
    for name, (attribute, kind) in _ATTRIBUTES.items():
        with suppress(KeyError, TypeError, ValueError, ZeroDivisionError):  # absent, or damaged
            attributes[attribute] = kind(values[_NUMBER[name]])
    return attributes


def _of_file(photo: Photo | None) -> Image.Exif:
    """The EXIF of the photo's file; empty where there is none, or it is damaged."""
    if photo is None:
        return Image.Exif()
    source = photo.source
    with suppress(Exception):  # a photo with damaged EXIF is read, so pictures of it are written
        if source is None:
            exif = Image.Exif()
            exif.load(photo.exif or b"")
            return exif
        # RAW files are TIFF inside, which Pillow's opener does not know.
        if is_tiff(source) or Path(photo.path or "").suffix.lower() in RAW_SUFFIXES:
            exif = Image.Exif()
            exif.load_from_fp(io.BytesIO(source))
            return exif
        from pillow_heif import register_heif_opener

        register_heif_opener()
        with pixel_limit_lifted(), Image.open(io.BytesIO(source)) as image:
            return image.getexif()
    return Image.Exif()


def _directory(exif: Image.Exif, number: int) -> dict[int, Any]:
    with suppress(Exception):
        return exif.get_ifd(number)
    return {}
