"""The colour space that a picture states without an ICC profile: PNG chunks, nclx boxes, EXIF."""

import struct
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from materialist.io import colour_space as spaces
from materialist.io.boxes import nclx
from materialist.io.colour_space import ColourSpace, Curve, Primaries, space

_LARGEST_CHUNK = 1 << 20
"""Bytes of a PNG chunk that is kept; those of colour are small."""
_BMP_CALIBRATED = bytes(4)
_BMP_EMBEDDED = b"DEBM"
_BMP_LINKED = b"KNIL"
"""LCS_CALIBRATED_RGB, PROFILE_EMBEDDED ("MBED") and PROFILE_LINKED ("LINK") as they lie in the file."""
_UNCALIBRATED = 65535
_ADOBE_RGB = 2

_PRIMARIES: dict[int, Primaries] = {
    1: spaces.REC709,
    4: (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316),
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 0.3127, 0.3290),
    6: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, 0.3127, 0.3290),
    7: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, 0.3127, 0.3290),
    8: (0.681, 0.319, 0.243, 0.692, 0.145, 0.049, 0.310, 0.316),
    9: spaces.REC2020,
    10: spaces.CIE_XYZ,
    11: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.314, 0.351),
    12: spaces.DISPLAY_P3,
    22: (0.630, 0.340, 0.295, 0.605, 0.155, 0.077, 0.3127, 0.3290),
}
"""ColourPrimaries of ITU-T H.273."""
_TRANSFERS: dict[int, tuple[str, Curve]] = {
    4: ("gamma 2.2", spaces.power_curve(2.2)),
    5: ("gamma 2.8", spaces.power_curve(2.8)),
    8: ("linear", spaces.linear_curve),
    13: ("sRGB", spaces.srgb_curve),
    16: ("PQ", spaces.pq_curve),
    18: ("HLG", spaces.hlg_curve),
}
"""TransferCharacteristics of ITU-T H.273."""
_UNSPECIFIED = 2
_VIDEO_TRANSFERS = (1, 6, 11, 14, 15)
_VIDEO_PRIMARIES = (5, 6, 7)
"""The camera curve of BT.709, BT.601 and BT.2020, and the primaries of BT.601: encoders of stills have written them for
years over plain sRGB (libheif 1.17, libultrahdr, Android)."""
HDR_NOTES = {
    "PQ": f"The photo is PQ: it is read as light, and {spaces.HDR_WHITE:g} cd/m2 are white.",
    "HLG": "The photo is HLG: it is read as the light of the scene, and 75 % of the signal are white.",
}


def stated_space(
    path: Path, kind: str | None, tags: Mapping[str, Any], notes: list[str]
) -> ColourSpace | None:
    """What a picture of Pillow's format `kind` says of its colours beside ICC; None for sRGB or nothing.

    What cannot be used is added to `notes`.
    """
    if kind == "PNG":
        stated, colours = _png_space(path, notes)
    elif kind in ("BMP", "DIB") and _bmp_states_colours(path):
        notes.append("The BMP states colours of its own, which are not read; it is taken as sRGB.")
        return None
    else:
        # HEIC and AVIF state it in a box, PNG in chunks, others in EXIF alone.
        codes = nclx(path) if kind in ("AVIF", "HEIF") else None
        stated = codes is not None
        colours = cicp_space(*codes, notes) if codes else None
    return colours if stated else exif_space(tags, notes)


def png_chunks(path: Path) -> dict[bytes, bytes]:
    """Chunks before the pixels of a PNG: kind -> content."""
    chunks: dict[bytes, bytes] = {}
    with path.open("rb") as file:
        file.seek(8)
        # Chunks: length, kind, content, checksum.
        while len(head := file.read(8)) == 8:
            size, kind = struct.unpack(">I4s", head)
            if kind in (b"IDAT", b"IEND"):
                break
            if size > _LARGEST_CHUNK:
                file.seek(size, 1)
            else:
                chunks.setdefault(kind, file.read(size))
            file.seek(4, 1)
    return chunks


def cicp_space(
    primaries: int, transfer: int, notes: list[str], *, full_range: bool = True
) -> ColourSpace | None:
    """The space of two codes of ITU-T H.273, with a note of what is not known; None for sRGB.

    Without `full_range`, black and white are the levels 16 and 235 of 255.
    """
    if transfer in _VIDEO_TRANSFERS:
        notes.append(
            f"The file states the curve of video cameras (code {transfer}, ITU-T H.273); it is taken as sRGB's."
        )
        primaries = 1 if primaries in _VIDEO_PRIMARIES else primaries
        transfer = 13
    # --- Codes that are not known count as sRGB and Rec.709, with a note ---
    name, curve = _TRANSFERS.get(transfer, _TRANSFERS[13])
    if primaries not in (0, _UNSPECIFIED, *_PRIMARIES) or transfer not in (
        0,
        _UNSPECIFIED,
        *_TRANSFERS,
    ):
        notes.append(
            f"The file states colours by the codes {primaries} and {transfer} (ITU-T H.273), which are not all known; "
            f"they are taken as {name} with the primaries of {'the code' if primaries in _PRIMARIES else 'Rec.709'}."
        )
    if name in HDR_NOTES:
        notes.append(HDR_NOTES[name])
    if not full_range:
        curve = partial(spaces.narrow_curve, curve=curve)
    stated = space(
        name, _PRIMARIES.get(primaries, spaces.REC709), curve, is_light=name in HDR_NOTES
    )
    return None if stated.is_srgb else stated


def exif_space(tags: Mapping[str, Any], notes: list[str]) -> ColourSpace | None:
    """The space that EXIF (or TIFF) tags name: Adobe RGB, or primaries of their own; None for sRGB or nothing."""
    # --- Adobe RGB has no code in EXIF: interoperability index R03 means it ---
    stated = tags.get("ColorSpace")
    index = str(tags.get("InteropIndex", "")).strip("\0 ")
    if stated == _ADOBE_RGB or (index == "R03" and stated != 1):
        return space("Adobe RGB", spaces.ADOBE_RGB, spaces.power_curve(563 / 256))
    # --- Primaries of its own ---
    primaries = tags.get("PrimaryChromaticities")
    white = tags.get("WhitePoint")
    if stated != 1 and primaries is not None and white is not None:
        gamma = tags.get("Gamma")
        try:
            curve = spaces.power_curve(float(gamma)) if gamma else spaces.srgb_curve
            colours = space("EXIF", [float(value) for value in (*primaries, *white)], curve)
            return None if colours.is_srgb else colours
        except (TypeError, ValueError, ZeroDivisionError):
            notes.append("The primaries in EXIF cannot be used; the photo is taken as sRGB.")
            return None
    if stated == _UNCALIBRATED:
        notes.append(
            "EXIF says that the colours are not sRGB, but not which; the photo is taken as sRGB."
        )
    return None


def _png_space(path: Path, notes: list[str]) -> tuple[bool, ColourSpace | None]:
    """Whether a PNG states its colours (by the first of cICP, sRGB, and gAMA and cHRM), and as which space."""
    chunks = png_chunks(path)
    try:
        if b"cICP" in chunks:
            primaries, transfer, _, full_range = struct.unpack(">4B", chunks[b"cICP"])
            return True, cicp_space(primaries, transfer, notes, full_range=bool(full_range))
        # The sRGB chunk goes before gAMA and cHRM, which then only repeat it.
        if b"sRGB" in chunks or not chunks.keys() & {b"gAMA", b"cHRM"}:
            return b"sRGB" in chunks, None
        return True, _of_gamma(chunks)
    except (struct.error, ValueError, ZeroDivisionError) as error:
        notes.append(
            f"The colours that the PNG states cannot be used ({error}); the photo is taken as sRGB."
        )
        return True, None


def _of_gamma(chunks: Mapping[bytes, bytes]) -> ColourSpace | None:
    """The space of gAMA and cHRM chunks; None for sRGB. Raises struct.error, ValueError or ZeroDivisionError."""
    primaries: Sequence[float] = spaces.REC709
    if b"cHRM" in chunks:
        # cHRM has white first, in units of 1e-5.
        white_x, white_y, *colours = (
            value / 1e5 for value in struct.unpack(">8I", chunks[b"cHRM"])
        )
        primaries = (*colours, white_x, white_y)
    curve: Curve = spaces.srgb_curve
    if b"gAMA" in chunks:
        (gamma,) = struct.unpack(">I", chunks[b"gAMA"])
        if not 10_000 <= gamma <= 500_000:
            raise ValueError(f"gamma {gamma / 1e5:g}")
        # Files in sRGB carry 1 / 2.2 for programs that know no more; a wider space means the power itself.
        if gamma != 45_455 or not _is_rec709(primaries):
            curve = spaces.power_curve(1e5 / gamma)
    stated = space("gAMA and cHRM", primaries, curve)
    return None if stated.is_srgb else stated


def _is_rec709(primaries: Sequence[float]) -> bool:
    return max(abs(a - b) for a, b in zip(primaries, spaces.REC709)) < 2e-3


def _bmp_states_colours(path: Path) -> bool:
    """Whether the header of a BMP (version 4 or 5) has primaries or a profile; most say sRGB or nothing."""
    with path.open("rb") as file:
        head = file.read(74)
    start = 0 if head[:2] != b"BM" else 14
    header = head[start:]
    if len(header) < 60 or int.from_bytes(header[:4], "little") < 108:
        return False
    return header[56:60] in (_BMP_CALIBRATED, _BMP_EMBEDDED, _BMP_LINKED)
