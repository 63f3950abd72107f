"""Embedded ICC profiles: which of them are a colour space of curves and a matrix.

Matrix profiles (sRGB, Display P3, Adobe RGB, ProPhoto, every camera and display) and grey ones are evaluated in float,
at the depth of the file; printing and table profiles go through LittleCMS at 8 bits (`bitmap`).
"""

import struct
from functools import partial

import numpy as np

from materialist.io.colour_space import ColourSpace, Curve, d50_to_rec709, linear_curve, power_curve
from materialist.types import Array


def matrix_profile(profile: bytes) -> ColourSpace | None:
    """The space of an RGB matrix profile or a grey one; None when it is of another kind or damaged."""
    try:
        tags = _tags(profile)
        if profile[16:20] == b"GRAY" and b"kTRC" in tags:
            return ColourSpace("ICC profile", (_curve(tags[b"kTRC"]),) * 3, np.eye(3))
        if profile[16:20] != b"RGB " or profile[20:24] != b"XYZ " or b"rXYZ" not in tags:
            return None
        # Columns are XYZ under D50, in 1/65536.
        columns = [struct.unpack_from(">3i", tags[name], 8) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
        red, green, blue = (_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC"))
    except (KeyError, ValueError, IndexError, struct.error):
        return None
    return ColourSpace(
        "ICC profile", (red, green, blue), d50_to_rec709() @ np.array(columns).T / 65536
    )


def _tags(profile: bytes) -> dict[bytes, bytes]:
    """Tag table of an ICC profile: signature -> data."""
    (count,) = struct.unpack_from(">I", profile, 128)
    entries = (struct.unpack_from(">4sII", profile, 132 + 12 * i) for i in range(min(count, 200)))
    return {name: profile[start : start + size] for name, start, size in entries}


def _curve(data: bytes) -> Curve:
    """The curve of a curveType or parametricCurveType tag (ICC.1:2010, 10.5 and 10.15)."""
    if data[:4] == b"curv":
        # One number is a power (in 1/256), several are samples at equal distances.
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return linear_curve
        values = np.frombuffer(data, ">u2", count, 12).astype(float)
        return (
            power_curve(float(values[0]) / 256)
            if count == 1
            else partial(_sampled, samples=values / 65535)
        )
    if data[:4] != b"para":
        raise ValueError("not a curve")
    (kind,) = struct.unpack_from(">H", data, 8)
    # --- A formula: the kind says how many of its parameters are stored ---
    number = {0: 1, 1: 3, 2: 4, 3: 5, 4: 7}[kind]
    g, a, b, c, d, e, f = [v / 65536 for v in struct.unpack_from(f">{number}i", data, 12)] + [
        0.0
    ] * (7 - number)
    if kind == 0:
        a = 1.0
    elif kind < 3:  # without a line below the curve, and c is added to it
        c, d, e, f = 0.0, -b / a, c, c
    return partial(_parametric, parameters=(g, a, b, c, d, e, f))


def _sampled(encoded: Array, samples: Array) -> Array:
    """Samples at equal distances from 0 to 1, continued by the last two."""
    inside = np.interp(encoded, np.linspace(0, 1, len(samples)), samples)
    # Above white the curve goes on straight: HDR values must not be cut.
    slope = (samples[-1] - samples[-2]) * (len(samples) - 1)
    return inside + np.maximum(encoded - 1, 0) * slope


def _parametric(encoded: Array, parameters: tuple[float, ...]) -> Array:
    g, a, b, c, d, e, f = parameters
    return np.where(encoded >= d, np.maximum(a * encoded + b, 0) ** g + e, c * encoded + f)
