"""A hole filled at working size, at the photo's native size: with the detail of its sources, along smooth outlines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from materialist.edits.composite.upsample import strips, window
from materialist.edits.remove.exemplar import Plan
from materialist.types import Array, Photo

SMOOTH = 1.0
"""Standard deviation, working pixels, by which outlines are smoothed at native size."""
SHARP = 2.0
"""How fast one surface gives way to the next: 1 / SHARP working pixels, about as in a photo enlarged so far."""


def with_hole(photo: Photo, linear: Array, hole: Array, plan: Plan | None, label: Array) -> Photo:
    """The photo with a hole [H, W] bool filled by `linear` [H, W, 3], at native size with the detail of its sources.

    `label` [H, W] int: surfaces, in the hole and around it; they part along smooth lines at native size.
    """
    native = photo.original.shape[:2]
    if native == hole.shape:
        original = np.where(hole[..., None], linear, photo.original).astype(np.float32)
        return replace(photo, linear=linear.astype(np.float32), original=original)
    share = outline(hole, native)
    original = photo.original.copy()
    if share.any():
        shift = _shift(plan, hole.shape)
        surfaces = [_Surface.of(own, linear, hole) for own in _surfaces(label, hole)]
        box, columns = window(hole, native)
        for rows in strips(box.stop, start=box.start):
            part = (rows, columns)
            picture = _of_all(photo, surfaces, hole, shift, part)
            original[part] = laid(np.maximum(picture, 0), share[part], photo.original[part])
    return replace(photo, linear=linear.astype(np.float32), original=original)


@dataclass(frozen=True)
class _Surface:
    """One surface in a hole or at its rim, continued over the picture by its nearest pixels."""

    smooth: Array
    """[H, W] float32: where it is, with soft outlines."""
    row: Array
    column: Array
    """[H, W] int: the nearest pixel of it."""
    picture: Array
    """[H, W, 3] the filled picture of that pixel."""

    @staticmethod
    def of(own: Array, linear: Array, hole: Array) -> _Surface:
        """From where it is, [H, W] bool."""
        import cv2
        from scipy.ndimage import distance_transform_edt

        smooth = np.asarray(cv2.GaussianBlur(own.astype(np.float32), (0, 0), SMOOTH))
        row, column = distance_transform_edt(~own, return_distances=False, return_indices=True)
        return _Surface(smooth, row, column, linear[row, column])


def laid(picture: Array, share: Array, photo: Array) -> Array:
    """[H0, W0, 3] a picture over the photo by its share [H0, W0]; bit for bit the photo where that is 0."""
    over = share[..., None]
    return np.where(over > 0, over * picture + (1 - over) * photo, photo).astype(np.float32)


def outline(mask: Array, native: tuple[int, int]) -> Array:
    """[H0, W0] float32 share of a mask at native size: nothing outside, rising from its smoothed outline inwards."""
    import cv2

    hard = cv2.resize(mask.astype(np.uint8), native[::-1], interpolation=cv2.INTER_NEAREST)
    if native == mask.shape:
        return hard.astype(np.float32)
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), SMOOTH)
    share = np.clip(4 * cv2.resize(smooth, native[::-1], interpolation=cv2.INTER_CUBIC) - 2, 0, 1)
    thin = mask & (cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)) == 0)
    thin = cv2.resize(thin.astype(np.uint8), native[::-1], interpolation=cv2.INTER_NEAREST)
    return np.where(thin > 0, 1, hard * share).astype(np.float32)


def _surfaces(label: Array, hole: Array) -> Iterator[Array]:
    """[H, W] bool of each surface in a hole or at its rim.

    Surfaces beside the hole go on into it by a pixel: so they end in the hole, where their outline is drawn anew.
    """
    import cv2
    from scipy.ndimage import distance_transform_edt

    inner = cv2.erode(hole.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) > 0
    beside = label[tuple(distance_transform_edt(hole, return_distances=False, return_indices=True))]
    label = np.where(hole & ~inner, beside, label)
    wide = cv2.dilate(hole.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    return (label == kind for kind in np.unique(label[wide]))


def _shift(plan: Plan | None, working: tuple[int, ...]) -> Array | None:
    """[H, W, 2] rows and columns from each filled pixel to its source."""
    if plan is None:
        return None
    shift = np.zeros((*working, 2))
    shift[plan.rows, plan.columns, 0] = plan.source // working[1] - plan.rows
    shift[plan.rows, plan.columns, 1] = plan.source % working[1] - plan.columns
    return shift


def _of_all(photo: Photo, surfaces: list[_Surface], hole: Array, shift: Array | None, box) -> Array:
    """[h, w, 3] a native window of the filled picture: each surface by its share of the pixels."""
    grid = _grid(photo.original.shape[:2], hole.shape, box)
    stack = np.stack([_sampled(surface.smooth, grid) for surface in surfaces])
    if len(surfaces) > 1:
        second, first = np.partition(stack, -2, axis=0)[-2:]
        lead = np.where(stack == first, stack - second, stack - first)
        stack = np.clip(0.5 + SHARP * lead, 0, 1)
    stack /= np.maximum(stack.sum(0), 1e-6)
    picture = np.zeros((*stack.shape[1:], 3), np.float32)
    for surface, share in zip(surfaces, stack):
        if share.any():
            picture += share[..., None] * _of_one(photo, surface, hole, shift, grid, box)
    return picture


def _of_one(photo: Photo, surface: _Surface, hole: Array, shift: Array | None, grid, box) -> Array:
    """[h, w, 3] a native window of the filled picture, as if one surface filled all of it; `grid` as of `_grid`."""
    native, working = photo.original.shape[:2], hole.shape
    x, y = grid
    picture = _sampled(surface.picture, grid)
    if shift is None:
        return picture
    # The native pixels' own working pixels, and of the surface the ones nearest to these.
    at = tuple(np.clip(np.round(v), 0, n - 1).astype(int) for v, n in zip((y, x), working))
    at = surface.row[at], surface.column[at]
    rows, columns = np.mgrid[box]
    moved = [np.round(shift[at][..., k] * native[k] / working[k]).astype(int) for k in (0, 1)]
    rows, columns = np.clip(rows + moved[0], 0, native[0] - 1), np.clip(columns + moved[1], 0, native[1] - 1)
    place = [
        ((v + 0.5) * w / n - 0.5).astype(np.float32) for v, w, n in zip((columns, rows), working[::-1], native[::-1])
    ]
    detail = photo.original[rows, columns] - _sampled(photo.linear, (place[0], place[1]))
    return picture + np.where(hole[at][..., None], detail, 0)


def _grid(native: tuple[int, int], working: tuple[int, ...], box) -> tuple[Array, Array]:
    """[h, w] float32 x and y at working size of the native pixels of a window."""
    rows, columns = (np.arange(part.start, part.stop) for part in box)
    y = (rows + 0.5) * working[0] / native[0] - 0.5
    x = (columns + 0.5) * working[1] / native[1] - 0.5
    grid = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    return grid[0], grid[1]


def _sampled(maps: Array, places: tuple[Array, Array]) -> Array:
    """Maps [H, W] or [H, W, C] at places (x, y), [h, w] each, linearly."""
    import cv2

    values = np.ascontiguousarray(maps, np.float32)
    return np.asarray(cv2.remap(values, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
