"""Colour Retinex: edges in colour are paint, soft changes of brightness are light (Grosse et al. 2009)."""

from __future__ import annotations

import numpy as np

from materialist.color import luminance
from materialist.types import Array

FLOOR = 0.01
"""Added to radiance before the logarithm, so that noise in the dark does not count as an edge."""
CHROMA_EDGE = (0.03, 0.10)
"""Change of log chromaticity between neighbours: below the first it is no edge, above the second it is paint."""
BRIGHTNESS_EDGE = (0.15, 0.45)
"""As above for log luminance: a grey edge this hard is paint, too (or a cast shadow: nothing tells them apart)."""
ALBEDO_RANGE = (0.04, 0.92)
REACH = 1.0
"""Over longer ways than this fraction of the picture brightness stays in the albedo: sums of edges drift."""
BRIGHTEST = 0.8
"""Luminance given to the 97th percentile of the albedo: the scale of light against paint is not in the picture."""


def separate(linear: Array) -> tuple[Array, Array]:
    """Albedo [H, W, 3] in ALBEDO_RANGE and shading [H, W] (> 0), float32, of a linear picture [H, W, 3].

    albedo * shading is the picture wherever the albedo was not clipped.
    """
    log = np.log(np.maximum(linear, 0).astype(np.float64) + FLOOR)  # [H, W, 3]
    brightness = np.log(np.maximum(luminance(linear), 0).astype(np.float64) + FLOOR)  # [H, W]
    chroma = log - log.mean(-1, keepdims=True)
    paint = []
    for axis in (0, 1):
        slope = np.diff(brightness, axis=axis)
        edge = np.maximum(
            _ramp(np.linalg.norm(np.diff(chroma, axis=axis), axis=-1), *CHROMA_EDGE),
            _ramp(np.abs(slope), *BRIGHTNESS_EDGE),
        )
        paint.append(slope * edge)
    reflectance = _integrate(paint[0], paint[1], brightness)  # [H, W] log, up to a constant
    shading = np.exp(brightness - reflectance)
    albedo = np.maximum(linear, 0) / shading[..., None]
    scale = BRIGHTEST / max(float(np.percentile(luminance(albedo), 97)), 1e-6)
    return np.clip(albedo * scale, *ALBEDO_RANGE).astype(np.float32), (shading / scale).astype(np.float32)


def _ramp(x: Array, low: float, high: float) -> Array:
    """0 below low, 1 above high, smooth between."""
    t = np.clip((x - low) / (high - low), 0, 1)
    return t * t * (3 - 2 * t)


def _integrate(down: Array, right: Array, anchor: Array) -> Array:
    """The field [H, W] whose forward differences are closest to down [H-1, W] and right [H, W-1].

    It is held weakly to `anchor` [H, W], which decides over distances beyond REACH: a screened Poisson equation with
    free borders, solved exactly in the cosine basis.
    """
    from scipy.fft import dctn, idctn

    h, w = anchor.shape
    hold = (np.pi / (REACH * max(h, w))) ** 2
    target = hold * anchor
    target[:-1] -= down
    target[1:] += down
    target[:, :-1] -= right
    target[:, 1:] += right
    eigen = (2 - 2 * np.cos(np.pi * np.arange(h) / h))[:, None] + (2 - 2 * np.cos(np.pi * np.arange(w) / w))[None, :]
    return idctn(dctn(target, type=2, norm="ortho") / (eigen + hold), type=2, norm="ortho")
