"""Under which shifts a plane looks like itself: found straight on, for all shifts at once.

Masked correlation by Fourier transforms (Padfield 2012), with the perspective taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from materialist.camera import project
from materialist.types import Array, Camera

KNOWN = 200
"""Fewest pixels of a plane, and cells of it straight on, that must be seen."""
CELLS = 160
"""Cells along the longer side of a plane looked at straight on."""
AROUND = 2.5
"""Surroundings of the hole that are looked at, in units of its extent on the plane."""
LEAST_OVERLAP = 0.12
"""Part of the plane's known cells, by their weight, that must have a partner after a shift."""
ALIKE = 0.22
"""Largest difference of a plane from its shifted self, relative to that of unlike pictures (1), that counts."""
WORSE = 0.06
"""Shifts this much worse than the best one are left out."""
FEATURED = 0.012
"""Least standard deviation (sRGB) of a plane's detail: a plain one has nothing that could be said to repeat."""
SHADING = 0.35
"""Waves longer than this part of the window are light, not pattern."""


@dataclass(frozen=True)
class Surface:
    """A plane, continued behind a hole."""

    point: Array
    """[H, W, 3] camera frame."""
    known: Array
    """[H, W] bool: what the picture shows of it."""
    hidden: Array
    """[H, W] bool: where the hole hides it."""


def periods(paint: Array, plane: Surface, camera: Camera) -> tuple[Array, Array]:
    """Shifts [K, 3] in scene units under which the plane's paint [H, W, C] looks like itself, best first.

    And the cell, [2, 3]: steps along the plane to which they are known. K is 0 where it never does.
    """
    frame = _Frame(plane)
    window, seen, sharp = frame.straight(paint, plane.known, camera)
    detail, cell = _detail(window, seen), frame.cell * frame.axes
    if seen.sum() < KNOWN or np.sqrt((detail**2)[seen].mean()) < FEATURED:
        return np.zeros((0, 3)), cell
    return _shifts(detail, sharp) @ cell, cell


class _Frame:
    """Coordinates on a plane, around what is hidden of it."""

    def __init__(self, plane: Surface):
        known, hidden = plane.point[plane.known], plane.point[plane.hidden]
        middle = hidden.mean(0)
        _, _, axes = np.linalg.svd((known - known.mean(0))[:: max(1, len(known) // 4000)], full_matrices=False)
        # Level and upright where the plane allows it: patterns mostly run so.
        normal = axes[2]
        level = np.cross(normal, [0.0, 1, 0])
        first = level if np.linalg.norm(level) > 0.2 else axes[0]
        first = first / np.linalg.norm(first)
        self.axes = np.stack([first, np.cross(normal, first)])  # [2, 3]
        own, others = (hidden - middle) @ self.axes.T, (known - middle) @ self.axes.T
        half = (0.5 + AROUND) * np.quantile(np.abs(own), 0.98, axis=0).max()
        self.low = np.maximum(others.min(0), -half)
        self.high = np.minimum(others.max(0), half)
        self.cell = float((self.high - self.low).max() / CELLS)
        self.middle = middle

    def straight(self, features: Array, known: Array, camera: Camera) -> tuple[Array, Array, Array]:
        """The plane [h, w, F] looked at straight on, where it is known [h, w], and there how sharp it is, in [0, 1]."""
        import cv2

        size = np.maximum(((self.high - self.low) / self.cell).astype(int), 8)
        u, v = (self.low[k] + (np.arange(size[k]) + 0.5) * self.cell for k in range(2))
        at = self.middle + u[None, :, None] * self.axes[0] + v[:, None, None] * self.axes[1]
        place, ahead = project(at, camera)
        x, y = (np.where(ahead > 0, place[..., k] - 0.5, -9).astype(np.float32) for k in range(2))
        read = lambda m: cv2.remap(  # noqa: E731
            np.ascontiguousarray(m, np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0
        )
        seen = read(known.astype(np.float32)) > 0.99
        channels = [read(np.where(known, features[..., k], 0)) for k in range(features.shape[-1])]
        (y_v, y_u), (x_v, x_u) = np.gradient(y), np.gradient(x)
        pixels = np.abs(y_v * x_u - y_u * x_v)  # [h, w] of a cell
        sharp = np.where(seen, np.clip(pixels, 0, 1), 0)
        return np.where(seen[..., None], np.stack(channels, -1), 0), seen, sharp


def _detail(window: Array, seen: Array) -> Array:
    """[h, w, F] without what changes slowly, 0 where nothing is seen."""
    from scipy.ndimage import gaussian_filter

    sigma = SHADING * max(seen.shape) / 2
    weight = gaussian_filter(seen.astype(float), sigma)[..., None]
    slow = gaussian_filter(window, (sigma, sigma, 0)) / np.maximum(weight, 1e-6)
    return np.where(seen[..., None], window - slow, 0)


def _shifts(detail: Array, weight: Array) -> Array:
    """[K, 2] shifts (u, v) in cells under which the picture looks like itself, best first; none if it never does.

    weight: [h, w] in [0, 1], 0 where nothing is seen; what is far away is blurred, and unlike itself nearby.
    """
    from scipy.ndimage import minimum_filter

    height, width = weight.shape
    shape = (2 * height, 2 * width)
    spectrum = lambda a: np.fft.rfft2(a, shape)  # noqa: E731
    correlate = lambda a, b: np.fft.irfft2(np.conj(a) * b, shape)  # noqa: E731  [s] = sum over p of a[p] b[p + s]
    there, energy = spectrum(weight), spectrum(weight * (detail**2).sum(-1))
    both = sum(correlate(s, s) for s in (spectrum(weight * detail[..., k]) for k in range(detail.shape[-1])))
    total = correlate(energy, there) + correlate(there, energy)
    overlap = correlate(there, there)
    enough = overlap > LEAST_OVERLAP * (weight**2).sum()
    # 0 where the shifted picture is the same, 1 where they have nothing to do with each other.
    apart = np.where(enough, (total - 2 * both) / np.maximum(total, 1e-9), 2.0)
    apart = np.fft.fftshift(apart)
    best = (apart == minimum_filter(apart, 5, mode="wrap")) & (apart < ALIKE)
    centre = np.array([height, width])
    found = np.argwhere(best)
    found = found[np.abs(found - centre).max(1) > 3]  # every picture looks like itself nearly where it is
    if not len(found):
        return np.zeros((0, 2))
    price = apart[found[:, 0], found[:, 1]]
    found = found[price < price.min() + WORSE]
    fine = np.stack([_vertex(apart, *place) for place in found]) - centre
    away = np.linalg.norm(fine, axis=-1) / max(weight.shape)
    order = np.argsort(apart[found[:, 0], found[:, 1]] + 0.5 * WORSE * away)
    return fine[order][:, ::-1]


def _vertex(values: Array, row: int, column: int) -> Array:
    """[2] the minimum (row, column) of parabolas through a pixel and its neighbours."""
    out = np.array([row, column], float)
    for k, line in enumerate((values[row - 1 : row + 2, column], values[row, column - 1 : column + 2])):
        if len(line) == 3 and (bend := line[0] - 2 * line[1] + line[2]) > 1e-12 and line.max() < 2:
            out[k] += np.clip((line[0] - line[2]) / (2 * bend), -0.5, 0.5)
    return out
