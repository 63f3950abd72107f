"""ICC profiles of colour spaces (ICC.1:2022): what a written picture says of its colours."""

import struct
from functools import cache

import numpy as np

from materialist.io.colour_space import (
    ADOBE_RGB,
    DISPLAY_P3,
    REC709,
    REC2020,
    ColourSpace,
    Curve,
    d50_to_rec709,
    power_curve,
    space,
    srgb_curve,
    to_rec709,
)

_SAMPLES = 4096
"""Of a curve that is neither sRGB's nor a power."""
_SRGB = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
_DATE = (2026, 1, 1, 0, 0, 0)
"""The same for all, so that equal pictures are equal files."""
_D50 = (0.9642, 1.0, 0.8249)
_NAMES = {"sRGB": REC709, "Display P3": DISPLAY_P3, "Adobe RGB": ADOBE_RGB, "Rec.2020": REC2020}


def profile_of(colours: ColourSpace) -> bytes:
    """The profile of a space of curves and a matrix, as a display's."""
    columns = np.linalg.inv(d50_to_rec709()) @ colours.matrix
    tags = {
        b"desc": _text(_name(colours)),
        b"cprt": _text("No copyright, use freely"),
        b"wtpt": _xyz(_D50),
        **{name: _xyz(column) for name, column in zip((b"rXYZ", b"gXYZ", b"bXYZ"), columns.T)},
        **{name: _curve(curve) for name, curve in zip((b"rTRC", b"gTRC", b"bTRC"), colours.curves)},
    }
    return _file(tags)


@cache
def srgb_profile() -> bytes:
    """The profile of sRGB."""
    return profile_of(space("sRGB", REC709, srgb_curve))


def _name(colours: ColourSpace) -> str:
    """What people call the space, by its primaries."""
    known = (
        name
        for name, primaries in _NAMES.items()
        if np.allclose(to_rec709(primaries), colours.matrix, atol=1e-3)
    )
    name = next(known, None)
    if name is None:
        return colours.name
    expected_curve = power_curve(0) if name == "Adobe RGB" else srgb_curve
    same_kind = getattr(colours.curves[0], "func", colours.curves[0]) is getattr(
        expected_curve, "func", expected_curve
    )
    return name if same_kind else f"{name} primaries"


def _file(tags: dict[bytes, bytes]) -> bytes:
    """The header, the table and the tags, each from a multiple of four bytes."""
    # The header has 128 bytes, then the number of tags, and 12 bytes for each.
    start = 132 + 12 * len(tags)
    table = b""
    body = b""
    for name, content in tags.items():
        table += struct.pack(">4sII", name, start + len(body), len(content))
        body += content + b"\0" * (-len(content) % 4)
    kind = struct.pack(">I4sI4s4s4s", 0, b"\0" * 4, 0x04400000, b"mntr", b"RGB ", b"XYZ ")
    rest = struct.pack(">6H4s", *_DATE, b"acsp") + b"\0" * 28 + _s15(*_D50)
    header = struct.pack(">I", start + len(body)) + kind[4:] + rest
    return header.ljust(128, b"\0") + struct.pack(">I", len(tags)) + table + body


def _s15(*values: float) -> bytes:
    """Signed numbers of 16 bits before the point and 16 behind it."""
    return struct.pack(f">{len(values)}i", *(round(float(value) * 65536) for value in values))


def _xyz(values) -> bytes:
    return b"XYZ \0\0\0\0" + _s15(*values)


def _text(text: str) -> bytes:
    encoded = text.encode("utf-16-be")
    return b"mluc" + struct.pack(">III2s2sII", 0, 1, 12, b"en", b"US", len(encoded), 28) + encoded


def _curve(curve: Curve) -> bytes:
    """A curve's formula where it is one of the two that files have, else samples of it."""
    if curve is srgb_curve:
        return b"para" + struct.pack(">IHH", 0, 3, 0) + _s15(*_SRGB)
    # A `partial` of the power curve carries its exponent.
    exponent = getattr(curve, "keywords", {}).get("exponent")
    if exponent is not None:
        return b"para" + struct.pack(">IHH", 0, 0, 0) + _s15(exponent)
    # Other curves, such as PQ, by samples of 16 bits.
    samples = np.round(np.clip(curve(np.linspace(0, 1, _SAMPLES)), 0, 1) * 65535).astype(">u2")
    return b"curv" + struct.pack(">II", 0, _SAMPLES) + samples.tobytes()
