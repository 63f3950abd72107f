"""Translational symmetry of planes: tiles, boards and chequers repeat, and go on behind what hides them.

The plane is seen straight on, where masked correlation (Padfield 2012) tells under which shifts its albedo looks like
itself; a hidden pixel takes its value from where such shifts lead (the offset statistics of He and Sun 2012).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from materialist.camera import pixel_rays, project
from materialist.geometry.silhouette import grown
from materialist.types import Array, Camera


@dataclass(frozen=True)
class TranslationSettings:
    """When a plane counts as periodic; tuned on the 19 rooms of `bench glass`."""

    cells: int = 160  # along the longer side of the rectified plane; more: finer shifts
    around: float = 2.5  # surroundings of the hole that are compared, in its extents; more: larger periods
    overlap: float = 0.12  # least part of the known plane that a shift compares; less: larger periods, more accidents
    unlike: float = 0.22  # largest difference after a shift, 1: unrelated; more: fainter patterns, more accidents
    contrast: float = 0.012  # least standard deviation of a pattern, sRGB
    error: float = 0.6  # largest error of prediction beside that of one colour; more: less regular patterns
    repeats: int = 16  # shifts whose median a pixel follows; more: fewer shadows are copied
    fewest: int = 200  # pixels of a plane that must be seen
    hidden: int = 16  # pixels of a plane that must be hidden; less: smaller holes follow a pattern


SETTINGS = TranslationSettings()


def repeated_sources(
    albedo: Array, shown: Array, hole: Array, source: Array, label: Array, depth: Array, camera: Camera
) -> Array:  # fmt: skip
    """[H, W] int: the row-major pixel from which periodic planes say that a pixel of a hole takes its value; -1: none.

    albedo: [H, W, 3] sRGB, which repeats whatever light falls on it. shown: [H, W, F] in [0, 1]: of the repeats of
        a place the most usual one is taken. Neither is read in the hole.
    hole: [H, W] bool. source: [H, W] bool: what may be copied.
    label: [H, W] int: the plane of a pixel, < 0 for none. depth: [H, W] planar. Both known in the hole too.
    """
    import cv2

    found = np.full(hole.shape, -1)
    points = pixel_rays(camera) * depth[..., None]
    for k in np.unique(label[hole & (label >= 0)]):
        own = (label == k) & (depth > 0)
        whole = cv2.erode(own.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=1) > 0  # borders mix surfaces
        known, hidden = whole & source & ~hole, own & hole
        if known.sum() < SETTINGS.fewest or hidden.sum() < SETTINGS.hidden:
            continue
        some = np.random.default_rng(0).permutation(np.flatnonzero(known))[:2000]
        near = np.flatnonzero(known & grown(hidden, int(np.ceil(0.25 * np.sqrt(hidden.sum())))))
        shifts = _shifts(albedo, points, known, hidden, camera)
        shifts = [
            s for s in shifts if _error(albedo, some, _landings(points, some, [s], known, camera)) < SETTINGS.error
        ]
        if shifts and not _error(albedo, near, _landings(points, near, shifts, known, camera)) >= SETTINGS.error:
            at = np.flatnonzero(hidden)
            found.ravel()[at] = _usual(shown, _landings(points, at, shifts, known, camera), SETTINGS.repeats)
    return found


def _landings(points: Array, at: Array, shifts, known: Array, camera: Camera) -> Array:
    """[K, P] known row-major pixels to which pixels `at` [P] are moved by shifts [K, 3], scene units; -1 for none."""
    height, width = known.shape
    place, ahead = project(points.reshape(-1, 3)[at] + np.asarray(shifts)[:, None], camera)
    column, row = np.moveaxis(np.floor(place).astype(int), -1, 0)
    inside = (ahead > 0) & (row >= 0) & (row < height) & (column >= 0) & (column < width)
    landing = np.where(inside, row * width + column, 0)
    return np.where(inside & known.ravel()[landing], landing, -1)


def _error(albedo: Array, at: Array, landings: Array) -> float:
    """Mean error of what landings [K, P] predict of pixels `at` [P], relative to that of their median colour.

    A constant between a place and its repeat does not count: a fitted albedo keeps some of the light. NaN where nothing
    is predicted, or only what is plain.
    """
    values = albedo.reshape(-1, albedo.shape[-1])
    own = values[at]
    off = np.full((len(landings), *own.shape), np.nan)
    for row, landing in zip(off, landings):
        told = landing >= 0
        if told.sum() >= 30:
            change = values[landing[told]] - own[told]
            row[told] = change - change.mean(0)
    told = np.isfinite(off[..., 0]).any(0)
    plain = np.abs(own - np.median(own, 0)).mean(-1)
    if not told.any() or plain[told].mean() < max(0.5 * plain.mean(), 1e-3):
        return float("nan")
    return float(np.abs(np.nanmedian(off[:, told], 0)).mean() / plain[told].mean())


def _usual(shown: Array, landings: Array, repeats: int) -> Array:
    """[P] of the first landings [K, P] the one nearest to their median, which leaves out shadows; -1 for none."""
    order = np.argsort(landings < 0, axis=0, kind="stable")[:repeats]
    landings = np.take_along_axis(landings, order, 0)
    seen = np.where((landings >= 0)[..., None], shown.reshape(-1, shown.shape[-1])[landings], np.nan)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # pixels that no shift tells
        off = np.nan_to_num(np.abs(seen - np.nanmedian(seen, 0)).max(-1), nan=np.inf)
    return np.take_along_axis(landings, np.maximum(off, 0.06).argmin(0)[None], 0)[0]  # alike ones: the best shift


def _shifts(albedo: Array, points: Array, known: Array, hidden: Array, camera: Camera) -> list[Array]:
    """[3] each, scene units: shifts under which a plane looks like itself, best first."""
    import cv2
    from scipy.ndimage import minimum_filter

    _, _, axes = np.linalg.svd(
        points[known][:: max(1, known.sum() // 4000)] - points[known].mean(0), full_matrices=False
    )
    level = np.cross(axes[2], [0.0, 1, 0])  # patterns mostly run level and upright
    first = level / np.linalg.norm(level) if np.linalg.norm(level) > 0.2 else axes[0]
    axes = np.stack([first, np.cross(axes[2], first)])  # [2, 3]
    middle = points[hidden].mean(0)
    inside, beside = ((points[mask] - middle) @ axes.T for mask in (hidden, known))
    half = (0.5 + SETTINGS.around) * np.quantile(np.abs(inside), 0.98, axis=0).max()
    low, high = np.maximum(beside.min(0), -half), np.minimum(beside.max(0), half)
    cell = float((high - low).max() / SETTINGS.cells)
    u, v = (low[k] + (np.arange(max(int((high[k] - low[k]) / cell), 8)) + 0.5) * cell for k in (0, 1))
    place, ahead = project(middle + u[None, :, None] * axes[0] + v[:, None, None] * axes[1], camera)
    x, y = (np.where(ahead > 0, place[..., k] - 0.5, -9).astype(np.float32) for k in (0, 1))
    read = lambda m: cv2.remap(np.ascontiguousarray(m, np.float32), x, y, cv2.INTER_LINEAR, borderValue=0)  # noqa: E731
    seen = read(known) > 0.99
    window = np.where(seen[..., None], read(np.where(known[..., None], albedo, 0)), 0)
    if seen.sum() < SETTINGS.fewest:
        return []
    (y_v, y_u), (x_v, x_u) = np.gradient(y), np.gradient(x)
    weight = np.where(seen, np.clip(np.abs(y_v * x_u - y_u * x_v), 0, 1), 0)  # what is far away is blurred
    ramp = np.stack([np.ones_like(x), *np.mgrid[: seen.shape[0], : seen.shape[1]]], -1)  # light, no pattern
    trend = ramp @ np.linalg.lstsq(ramp[seen], window[seen], rcond=None)[0]
    detail = np.where(seen[..., None], window - trend, 0)
    if detail[seen].std() < SETTINGS.contrast:
        return []
    height, width = seen.shape
    spectrum = lambda a: np.fft.rfft2(a, (2 * height, 2 * width))  # noqa: E731
    correlate = lambda a, b: np.fft.irfft2(np.conj(a) * b, (2 * height, 2 * width))  # noqa: E731  [s] = sum over p of a[p] b[p + s]
    there, energy = spectrum(weight), spectrum(weight * (detail**2).sum(-1))
    both = sum(correlate(s, s) for s in (spectrum(weight * part) for part in np.moveaxis(detail, -1, 0)))
    total, overlap = correlate(energy, there) + correlate(there, energy), correlate(there, there)
    apart = np.where(overlap > SETTINGS.overlap * (weight**2).sum(), (total - 2 * both) / np.maximum(total, 1e-9), 2)
    apart = np.fft.fftshift(apart)  # 0: the same picture, 1: an unrelated one
    peaks = np.argwhere((apart == minimum_filter(apart, 5, mode="wrap")) & (apart < SETTINGS.unlike))
    peaks = peaks[np.abs(peaks - (height, width)).max(1) > 3]  # every picture looks like itself nearly where it is
    order = np.argsort(apart[tuple(peaks.T)])[:200]
    return [((_vertex(apart, *peaks[k]) - (height, width))[::-1] * cell) @ axes for k in order]


def _vertex(values: Array, row: int, column: int) -> Array:
    """[2] the minimum (row, column) of parabolas through a pixel and its neighbours."""
    out = np.array([row, column], float)
    for k, line in enumerate((values[row - 1 : row + 2, column], values[row, column - 1 : column + 2])):
        if len(line) == 3 and (bend := line[0] - 2 * line[1] + line[2]) > 1e-12 and line.max() < 2:
            out[k] += np.clip((line[0] - line[2]) / (2 * bend), -0.5, 0.5)
    return out
