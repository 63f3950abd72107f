"""Regular patterns on planes: chequers, tiles, boards and stripes repeat, and go on behind what hides them.

A plane is looked at straight on, and compared with itself after every shift at once (masked correlation by Fourier
transforms, Padfield 2012). Shifts under which it looks like itself say what a hidden place shows (the statistics of
offsets of He and Sun 2012, with the perspective taken out).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays, project
from materialist.types import Array, Camera

KNOWN, HIDDEN = 200, 16
"""Fewest pixels that must be known, and hidden, of a plane; smaller holes need no pattern."""
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
ENOUGH = 0.6
"""Part of what is hidden of a plane that its pattern must tell: a few alike places are no pattern."""
SKILL, TESTED = 0.65, 600
"""Largest error with which a pattern may tell what is known, relative to that of the plane's median colour, and how
many pixels are asked."""
HALF = 0.5
"""Least share of those that it must tell."""
REPEATS = 16
"""Repeats of a hidden place that are looked at, the best ones."""
BORDER = 2
"""Pixels next to the end of a plane that are not copied: they show what is beside it, too."""
USUAL = 0.06
"""Differences (sRGB) of what several shifts say up to which they say the same."""
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


def regular_sources(features: Array, hole: Array, source: Array, label: Array, depth: Array, camera: Camera) -> Array:
    """Where the patterns of planes say that each pixel of a hole takes its value from.

    Args:
        features: [H, W, F] what is compared, such as sRGB; not read in the hole.
        hole: [H, W] bool. source: [H, W] bool: what may be copied.
        label: [H, W] int: the plane of a pixel, < 0 for none. depth: [H, W] planar. Both known in the hole too.

    Returns:
        [H, W] int row-major pixel, -1 where no pattern tells it.
    """
    found = np.full(hole.shape, -1)
    points = pixel_rays(camera) * depth[..., None]
    for k in np.unique(label[hole]):
        if k < 0:
            continue
        own = (label == k) & (depth > 0)
        plane = Surface(points, _within(own) & source & ~hole, own & hole)
        if plane.known.sum() >= KNOWN and plane.hidden.sum() >= HIDDEN:
            found = np.where(found < 0, _on_plane(features, plane, camera), found)
    return found


def _within(mask: Array) -> Array:
    """A mask [H, W] without the pixels at its border, which show something else as well."""
    import cv2

    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=BORDER, borderValue=1) > 0


def _on_plane(features: Array, plane: Surface, camera: Camera) -> Array:
    """[H, W] sources of the hidden pixels of one plane, -1 for none."""
    frame = _Frame(plane)
    window, seen, sharp = frame.straight(features, plane.known, camera)
    detail, found = _detail(window, seen), np.full(plane.known.shape, -1)
    if seen.sum() < KNOWN or np.sqrt((detail**2)[seen].mean()) < FEATURED:
        return found
    shifts = _shifts(detail, sharp) * frame.cell @ frame.axes
    if not len(shifts) or _foretold(features, plane, shifts, camera) > SKILL:
        return found
    rows, columns = np.nonzero(plane.hidden)
    told = _repeated(features, plane, (rows, columns), shifts, camera)
    if (told >= 0).mean() <= ENOUGH:
        return found
    found[rows, columns] = told
    return found


def _foretold(features: Array, plane: Surface, shifts: Array, camera: Camera) -> float:
    """What the pattern says wrongly of places that are known, relative to the plane's median colour."""
    rows, columns = np.nonzero(plane.known)
    part = np.random.default_rng(0).permutation(len(rows))[:TESTED]
    at = rows[part], columns[part]
    source = _repeated(features, plane, at, shifts, camera)
    told = source >= 0
    if told.mean() < HALF:
        return np.inf
    values = features.reshape(-1, features.shape[-1])
    off = np.abs(values[source[told]] - features[at][told]).mean()
    plain = np.abs(features[at][told] - np.median(features[plane.known], 0)).mean()
    return float(off / max(plain, 1e-6))


def _repeated(
    features: Array, plane: Surface, at: tuple[Array, Array], shifts: Array, camera: Camera
) -> Array:  # fmt: skip
    """[P] row-major sources of pixels `at` (rows [P], columns [P]) after shifts [K, 3] (best first), -1 for none."""
    height, width = plane.known.shape
    rows, columns = at
    sources, count = np.full((REPEATS, len(rows)), -1), np.zeros(len(rows), int)
    for shift in shifts:
        unsure = np.flatnonzero(count < REPEATS)
        place, ahead = project(plane.point[rows[unsure], columns[unsure]] + shift, camera)
        column, row = np.floor(place).astype(int).T
        good = (ahead > 0) & (row >= 0) & (row < height) & (column >= 0) & (column < width)
        row, column = np.where(good, row, 0), np.where(good, column, 0)
        good &= plane.known[row, column]
        told = unsure[good]
        sources[count[told], told] = (row * width + column)[good]
        count[told] += 1
    return _usual(features.reshape(-1, features.shape[-1]), sources)


def _usual(values: Array, sources: Array) -> Array:
    """[P] of sources [K, P] the first one that shows about what most of them do, -1 where there is none.

    The median of them leaves out the shadows and reflections that lie at some of the places.
    """
    seen = np.where((sources >= 0)[..., None], values[np.maximum(sources, 0)], np.nan)  # [K, P, F]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # pixels that no shift tells
        off = np.abs(seen - np.nanmedian(seen, 0)).max(-1)  # [K, P]
    off = np.where(np.isnan(off), np.inf, np.maximum(off, USUAL))  # alike ones are equally good: the first is taken
    best = off.argmin(0)
    return sources[best, np.arange(sources.shape[1])]


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
