"""Colour spaces: encoded values of a file to linear Rec.709, by transfer curves, primaries and white point."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from materialist.color import ROWS
from materialist.types import Array

Curve = Callable[[Array], Array]
"""Encoded values, float64 with white at 1, to linear ones."""
Primaries = tuple[float, ...]
"""Chromaticities x, y of red, green, blue and white: eight numbers."""

_D65 = (0.3127, 0.3290)
REC709: Primaries = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, *_D65)
DISPLAY_P3: Primaries = (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, *_D65)
ADOBE_RGB: Primaries = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, *_D65)
REC2020: Primaries = (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, *_D65)
ACES_WHITE = (0.32168, 0.33767)
ACES_AP0: Primaries = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.0770, *ACES_WHITE)
ACES_AP1: Primaries = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, *ACES_WHITE)
CIE_XYZ: Primaries = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)

HDR_WHITE = 203.0
"""Luminance of white in an HDR picture, cd/m2 (ITU-R BT.2408)."""
_BRADFORD = np.array(
    [[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]]
)
_D50_WHITE = np.array([0.9642029, 1.0, 0.8249054])
"""XYZ of the white of ICC profiles and of CIELab in TIFF."""


@dataclass(frozen=True)
class ColourSpace:
    """What the three channels of a file mean."""

    name: str
    curves: tuple[Curve, Curve, Curve]
    matrix: Array
    """[3, 3] float64: linear values of the space to linear Rec.709."""
    is_light: bool = False
    """Whether values above white are light and stay, as in PQ and HLG; else the space ends at 1."""

    @property
    def is_srgb(self) -> bool:
        """Whether it is sRGB to within what an 8-bit file can tell apart."""
        levels = np.linspace(0, 1, 4096)
        curve_error = max(
            float(np.abs(curve(levels) - srgb_curve(levels)).max()) for curve in self.curves
        )
        return bool(np.abs(self.matrix - np.eye(3)).max() < 3e-3) and curve_error < 2e-3

    def linear(self, encoded: Array) -> Array:
        """[H, W, 3] of uint8, uint16 or float to [H, W, 3] float32 linear Rec.709.

        Whole levels are clipped to [0, 1] unless the space holds light; floats never are.
        """
        # Whole levels go through a table: as exact as the curve, and much faster.
        levels = encoded.dtype.kind == "u"
        out: Array = np.empty(encoded.shape, np.float32)
        tables = self._tables(encoded.dtype) if levels else None
        for start in range(0, len(encoded), ROWS):  # bounds the memory
            rows = encoded[start : start + ROWS]
            block = out[start : start + ROWS]
            for channel, curve in enumerate(self.curves):
                values = rows[..., channel]
                block[..., channel] = (
                    curve(values.astype(float)) if tables is None else tables[channel][values]
                )
        transformed(out, self.matrix)
        return np.clip(out, 0, 1, out=out) if levels and not self.is_light else out

    def _tables(self, levels: np.dtype) -> list[Array]:
        """Each channel's curve at every level."""
        top = np.iinfo(levels).max
        encoded = np.arange(top + 1) / top
        return [curve(encoded).astype(np.float32) for curve in self.curves]


def transformed(pixels: Array, matrix: Array) -> Array:
    """[H, W, 3] float32 times a colour matrix, in place; bit for bit as before where that is the identity."""
    if np.abs(matrix - np.eye(3)).max() > 1e-5:
        # Rows of pixels times the transposed matrix.
        turned = matrix.T.astype(np.float32)
        for start in range(0, len(pixels), ROWS):
            block = pixels[start : start + ROWS]
            block[...] = block @ turned
    return pixels


def space(
    name: str, primaries: Sequence[float], curve: Curve, *, is_light: bool = False
) -> ColourSpace:
    """A space of one curve for all channels. Raises ValueError for primaries that span no colours."""
    return ColourSpace(name, (curve,) * 3, to_rec709(primaries), is_light)


def rgb_to_xyz(primaries: Sequence[float]) -> Array:
    """[3, 3] float64: linear RGB to XYZ with white at Y = 1. Raises ValueError for primaries that span no colours."""
    # --- Colours of the primaries at Y = 1, weighed so that they sum to white ---
    xy = np.array(primaries, np.float64).reshape(4, 2)
    xyz = np.column_stack([xy, 1 - xy.sum(1)])
    colours = xyz[:3].T
    if not np.isfinite(xyz).all() or xy[3, 1] < 1e-3 or abs(np.linalg.det(colours)) < 1e-4:
        raise ValueError(
            f"the primaries {', '.join(f'{value:g}' for value in xy.ravel())} span no colours"
        )
    return colours * np.linalg.solve(colours, xyz[3] / xyz[3, 1])


def adapted(white: Array, new_white: Array) -> Array:
    """[3, 3] float64: XYZ under one white to XYZ under another (Bradford)."""
    # Cone responses scale by the ratio of the whites.
    cones = (_BRADFORD @ new_white) / (_BRADFORD @ white)
    return np.linalg.inv(_BRADFORD) @ (cones[:, None] * _BRADFORD)


def to_rec709(primaries: Sequence[float]) -> Array:
    """[3, 3] float64: linear RGB of these primaries to linear Rec.709; white becomes white. Raises ValueError."""
    source = rgb_to_xyz(primaries)
    target = rgb_to_xyz(REC709)
    return np.linalg.inv(target) @ adapted(source.sum(1), target.sum(1)) @ source


def d50_to_rec709() -> Array:
    """[3, 3] float64: XYZ under D50, as ICC profiles and CIELab have it, to linear Rec.709."""
    target = rgb_to_xyz(REC709)
    return np.linalg.inv(target) @ adapted(_D50_WHITE, target.sum(1))


def lab_to_rec709(lab: Array) -> Array:
    """CIELab under D50, [..., 3] with L in [0, 100], to [..., 3] float32 linear Rec.709, clipped to [0, 1]."""
    y = (lab[..., 0] + 16) / 116
    root = np.stack([y + lab[..., 1] / 500, y, y - lab[..., 2] / 200], -1)
    xyz = np.where(root > 6 / 29, root**3, 3 * (6 / 29) ** 2 * (root - 4 / 29)) * _D50_WHITE
    return np.clip(xyz @ d50_to_rec709().T, 0, 1).astype(np.float32)


# Transfer curves


def srgb_curve(encoded: Array) -> Array:
    """IEC 61966-2-1, continued above 1."""
    power = ((np.maximum(encoded, 0) + 0.055) / 1.055) ** 2.4
    return np.where(encoded <= 0.04045, encoded / 12.92, power)


def linear_curve(encoded: Array) -> Array:
    return encoded


def power_curve(exponent: float) -> Curve:
    """A plain power; values below 0 keep their sign."""
    return partial(_power, exponent=exponent)


def _power(encoded: Array, exponent: float) -> Array:
    return np.sign(encoded) * np.abs(encoded) ** exponent


def narrow_curve(encoded: Array, curve: Curve) -> Array:
    """A curve of a video signal, whose black and white are the levels 16 and 235 of 255."""
    return curve(np.clip((encoded * 255 - 16) / 219, 0, 1))


def pq_curve(encoded: Array) -> Array:
    """SMPTE ST 2084, in units of HDR_WHITE."""
    root = np.clip(encoded, 0, 1) ** (32 / 2523)
    share = np.maximum(root - 3424 / 4096, 0) / (2413 / 128 - 2392 / 128 * root)
    return 10000 / HDR_WHITE * share ** (8192 / 1305)


def hlg_curve(encoded: Array) -> Array:
    """ARIB STD-B67: light of the scene (without a display's gamma), in units of what 75 % stands for: white."""
    return _hlg(encoded) / _hlg(np.array(0.75))


def _hlg(encoded: Array) -> Array:
    a = 0.17883277
    b = 0.28466892
    c = 0.55991073
    return np.where(encoded <= 0.5, encoded**2 / 3, (np.exp((encoded - c) / a) + b) / 12)
