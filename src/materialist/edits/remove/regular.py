"""Regular patterns on planes: chequers, tiles, boards and stripes repeat, and go on behind what hides them.

Shifts under which a plane looks like itself (`edit.periods`) say what a hidden place shows (the statistics of offsets
of He and Sun 2012, with the perspective taken out), where they foretell what is known of it.
"""

from __future__ import annotations

import warnings

import numpy as np

from materialist.camera import pixel_rays, project
from materialist.edits.remove.periods import FEATURED, KNOWN, Surface, periods
from materialist.types import Array, Camera

HIDDEN = 16
"""Fewest pixels that must be hidden of a plane; smaller holes need no pattern."""
ENOUGH = 0.4
"""Part of what is hidden of a plane that its pattern must tell: a few alike places are no pattern."""
SKILL, TOGETHER = 0.56, 0.65
"""Largest error with which one shift, and many together, may tell what is known, relative to that of one colour."""
TESTED, FEWEST = 2000, 30
"""How many pixels are asked at most, and how many of them must be told."""
MANY, LISTED = 8, 200
"""Shifts from which on they are many, and that are looked at."""
APART = 3
"""Cells between shifts that are not the same."""
NEAR = 0.25
"""How far from what is hidden the pattern is asked once more, in units of its size: there it must go on."""
REPEATS = 16
"""Repeats of a hidden place that are looked at, the best ones."""
BORDER = 2
"""Pixels next to the end of a plane that are not copied: they show what is beside it, too."""
USUAL = 0.06
"""Differences (sRGB) of what several shifts say up to which they say the same."""

Places = tuple[Array, Array]
"""Rows [P] and columns [P] of pixels."""


def regular_sources(
    paint: Array, shown: Array, hole: Array, source: Array, label: Array, depth: Array, camera: Camera
) -> Array:
    """Where the patterns of planes say that each pixel of a hole takes its value from.

    Args:
        paint: [H, W, 3] sRGB albedo: what repeats, whatever light falls on it. shown: [H, W, F], such as sRGB: of the
            repeats of a place the one that shows about what most do is taken. Neither is read in the hole.
        hole: [H, W] bool. source: [H, W] bool: what may be copied.
        label: [H, W] int: the plane of a pixel, < 0 for none. depth: [H, W] planar. Both known in the hole too.

    Returns:
        [H, W] int row-major pixel, -1 where no pattern tells it.
    """
    found = np.full(hole.shape, -1)
    paint = np.ascontiguousarray(paint, np.float32)
    points = pixel_rays(camera) * depth[..., None]
    for k in np.unique(label[hole]):
        if k < 0:
            continue
        own = (label == k) & (depth > 0)
        plane = Surface(points, _within(own) & source & ~hole, own & hole)
        if plane.known.sum() >= KNOWN and plane.hidden.sum() >= HIDDEN:
            found = np.where(found < 0, _on_plane(paint, shown, plane, camera), found)
    return found


def _within(mask: Array) -> Array:
    """A mask [H, W] without the pixels at its border, which show something else as well."""
    import cv2

    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), iterations=BORDER, borderValue=1) > 0


def _on_plane(paint: Array, shown: Array, plane: Surface, camera: Camera) -> Array:
    """[H, W] sources of the hidden pixels of one plane, -1 for none."""
    found = np.full(plane.known.shape, -1)
    shifts = _proven(paint, plane, *periods(paint, plane, camera), camera)
    if not len(shifts):
        return found
    rows, columns = np.nonzero(plane.hidden)
    told = _repeated(shown, plane, (rows, columns), shifts, camera)
    beside = _some(_around(plane.hidden) & plane.known)
    asked = len(beside[0]) >= FEWEST
    if (told >= 0).mean() > ENOUGH and (not asked or _missed(paint, plane, beside, shifts, camera) <= TOGETHER):
        found[rows, columns] = told
    return found


def _some(mask: Array) -> Places:
    """At most TESTED pixels of a mask [H, W] bool."""
    rows, columns = np.nonzero(mask)
    part = np.random.default_rng(0).permutation(len(rows))[:TESTED]
    return rows[part], columns[part]


def _around(hidden: Array) -> Array:
    """What is near to a mask [H, W] bool, itself included."""
    import cv2

    wide = 2 * int(np.ceil(NEAR * np.sqrt(hidden.sum()))) + 1
    return cv2.dilate(hidden.astype(np.uint8), np.ones((wide, wide), np.uint8)) > 0


def _proven(paint: Array, plane: Surface, shifts: Array, cell: Array, camera: Camera) -> Array:
    """[K, 3] those of shifts, or sums of them, that foretell what is known of the plane; cell: [2, 3] steps on it.

    Many shifts prove each other together. Of few, each one has to do so alone, and backwards: some spots may look alike
    by accident. What repeats after two shifts repeats after both, also where too little is seen to compare.
    """
    at = _some(plane.known)
    if len(shifts) >= MANY:
        shifts = shifts[:LISTED]
        return shifts if _missed(paint, plane, at, shifts, camera) <= TOGETHER else np.zeros((0, 3))
    found = [_refined(paint, plane, at, shift, cell, camera) for shift in shifts]

    def true(shift: Array, unknown: bool = False) -> bool:
        off = [_missed(paint, plane, at, way[None], camera) for way in (shift, -shift)]
        return max((e for e in off if np.isfinite(e)), default=0.0 if unknown else np.inf) <= SKILL

    found = [shift for shift in found if true(shift)]
    steps, apart = np.array(found).reshape(-1, 3), APART * np.linalg.norm(cell[0])
    for both in (steps[i] + steps[j] for i, j in zip(*np.triu_indices(len(steps)), strict=True)):
        if np.linalg.norm([both, *(both - found)], axis=1).min() > apart and true(both, unknown=True):
            found.append(both)
    return np.array(found).reshape(-1, 3)


def _refined(paint: Array, plane: Surface, at: Places, shift: Array, cell: Array, camera: Camera) -> Array:
    """[3] the shift moved by at most a cell along both axes to where it foretells pixels `at` best."""
    from scipy.optimize import minimize

    how = {"initial_simplex": np.array([[0, 0], [1, 0], [0, 1.0]]), "xatol": 0.05, "fatol": 1e-3, "maxiter": 40}
    moved = minimize(
        lambda x: _missed(paint, plane, at, (shift + x @ cell)[None], camera), np.zeros(2), method="Nelder-Mead",
        options=how,
    )  # fmt: skip
    return shift + np.clip(moved.x, -1, 1) @ cell


def _missed(paint: Array, plane: Surface, at: Places, shifts: Array, camera: Camera) -> float:
    """How far what shifts [K, 3] foretell of pixels `at` is from what these show, relative to their median colour.

    They foretell the median of what they lead to. Where one of them leads, all may be brighter by a step and a slope: a
    fitted albedo keeps some of the light. Infinite where too few pixels are told; less than can be seen does not count.
    """
    import cv2

    own = paint[at]
    line = np.stack([np.ones(len(own)), *(x / max(paint.shape) for x in at)], -1)
    off = np.full((len(shifts), *own.shape), np.nan)
    for k, shift in enumerate(shifts):
        source, place = _landing(plane, at, shift, camera)
        told = source >= 0
        if told.sum() >= FEWEST:
            x, y = place[told].astype(np.float32).T[..., None] - np.float32(0.5)
            read = cv2.remap(paint, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[:, 0] - own[told]
            off[k, told] = read - line[told] @ np.linalg.lstsq(line[told], read, rcond=None)[0]
    known = np.isfinite(off[..., 0]).any(0)
    if not known.any():
        return np.inf
    plain = np.abs(own[known] - np.median(own[known], 0)).mean()
    return float(np.abs(np.nanmedian(off[:, known], 0)).mean() / max(plain, FEATURED))


def _landing(plane: Surface, at: Places, shift: Array, camera: Camera) -> tuple[Array, Array]:
    """[P] row-major pixels on which pixels `at` come by a shift [3], -1: nothing is known there; and places [P, 2]."""
    height, width = plane.known.shape
    place, ahead = project(plane.point[at] + shift, camera)
    column, row = np.floor(place).astype(int).T
    good = (ahead > 0) & (row >= 0) & (row < height) & (column >= 0) & (column < width)
    row, column = np.where(good, row, 0), np.where(good, column, 0)
    return np.where(good & plane.known[row, column], row * width + column, -1), place


def _repeated(shown: Array, plane: Surface, at: Places, shifts: Array, camera: Camera) -> Array:
    """[P] row-major sources of pixels `at` after shifts [K, 3] (best first), -1 for none."""
    rows, columns = at
    sources, count = np.full((REPEATS, len(rows)), -1), np.zeros(len(rows), int)
    for shift in shifts:
        unsure = np.flatnonzero(count < REPEATS)
        landing, _ = _landing(plane, (rows[unsure], columns[unsure]), shift, camera)
        told = unsure[landing >= 0]
        sources[count[told], told] = landing[landing >= 0]
        count[told] += 1
    return _usual(shown.reshape(-1, shown.shape[-1]), sources)


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
