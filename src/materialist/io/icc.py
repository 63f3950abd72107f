"""Embedded colour profiles: device values to linear Rec.709.

Matrix profiles (sRGB, Display P3, Adobe RGB, ProPhoto, every camera and display) are evaluated in float, at the depth
of the file; printing, grey and table profiles go through LittleCMS at 8 bits (`decode`).
"""

import struct
from dataclasses import dataclass

import numpy as np

from materialist.color import srgb_to_linear
from materialist.types import Array

# Bradford-adapted D50 colorants of Rec.709 primaries, as the sRGB profile stores them (columns R, G, B).
_REC709_D50 = np.array(
    [[0.4360747, 0.3850649, 0.1430804], [0.2225045, 0.7168786, 0.0606169], [0.0139322, 0.0971045, 0.7141733]]
)


@dataclass(frozen=True)
class MatrixProfile:
    """A three-channel profile made of one curve a channel and a matrix."""

    curves: tuple[Array, Array, Array]
    """Each [4096] float64: linear device value over encoded values 0 .. 1."""
    matrix: Array
    """[3, 3] float64: linear device RGB to linear Rec.709."""

    @property
    def is_srgb(self) -> bool:
        """Whether the profile is sRGB to within what an 8-bit file can tell apart."""
        encoded = np.linspace(0, 1, 4096)
        curve_off = max(float(np.abs(curve - srgb_to_linear(encoded)).max()) for curve in self.curves)
        return bool(np.abs(self.matrix - np.eye(3)).max() < 3e-3) and curve_off < 2e-3

    def linear(self, encoded: Array) -> Array:
        """[H, W, 3] uint8 or uint16 to [H, W, 3] float32 linear Rec.709, clipped to [0, 1]."""
        top = np.iinfo(encoded.dtype).max
        positions = np.arange(top + 1) / top
        out = np.empty(encoded.shape, np.float32)
        for channel, curve in enumerate(self.curves):
            table = np.interp(positions, np.linspace(0, 1, len(curve)), curve).astype(np.float32)
            out[..., channel] = table[encoded[..., channel]]
        return np.clip(out @ self.matrix.T.astype(np.float32), 0, 1)


def matrix_profile(profile: bytes) -> MatrixProfile | None:
    """Parse an RGB matrix profile, or None when it is of another kind or damaged."""
    try:
        tags = _tags(profile)
        if profile[16:20] != b"RGB " or profile[20:24] != b"XYZ " or b"rXYZ" not in tags:
            return None
        columns = [struct.unpack_from(">3i", tags[name], 8) for name in (b"rXYZ", b"gXYZ", b"bXYZ")]
        curves = tuple(_curve(tags[name]) for name in (b"rTRC", b"gTRC", b"bTRC"))
    except (KeyError, ValueError, IndexError, struct.error):
        return None
    return MatrixProfile(curves, np.linalg.inv(_REC709_D50) @ np.array(columns).T / 65536)  # type: ignore[arg-type]


def _tags(profile: bytes) -> dict[bytes, bytes]:
    """Tag table of an ICC profile: signature -> data."""
    (count,) = struct.unpack_from(">I", profile, 128)
    entries = (struct.unpack_from(">4sII", profile, 132 + 12 * i) for i in range(min(count, 200)))
    return {name: profile[start : start + size] for name, start, size in entries}


def _curve(data: bytes) -> Array:
    """A curveType or parametricCurveType tag sampled at 4096 encoded values in [0, 1] (ICC.1:2010, 10.5 and 10.15)."""
    x = np.linspace(0, 1, 4096)
    if data[:4] == b"curv":
        (count,) = struct.unpack_from(">I", data, 8)
        if count == 0:
            return x
        values = np.frombuffer(data, ">u2", count, 12).astype(float)
        return x ** (values[0] / 256) if count == 1 else np.interp(x, np.linspace(0, 1, count), values / 65535)
    if data[:4] != b"para":
        raise ValueError("not a curve")
    (kind,) = struct.unpack_from(">H", data, 8)
    number = {0: 1, 1: 3, 2: 4, 3: 5, 4: 7}[kind]
    g, a, b, c, d, e, f = [v / 65536 for v in struct.unpack_from(f">{number}i", data, 12)] + [0.0] * (7 - number)
    if kind == 0:
        a = 1.0
    elif kind < 3:  # without a line below the curve, and c is added to it
        c, d, e, f = 0.0, -b / a, c, c
    return np.where(x >= d, np.maximum(a * x + b, 0) ** g + e, c * x + f)
