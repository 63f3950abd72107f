"""A hole filled at working size, at the photo's native size: with the detail of its sources, along smooth outlines."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from materialist.edits.composite.upsample import strips, window
from materialist.edits.remove.patches import Plan
from materialist.types import Array, Photo

SMOOTH = 1.0
"""Standard deviation, working pixels, by which outlines are smoothed at native size; tuned by eye."""
Places = tuple[Array, Array]
"""[h, w] float32 x and y at working size, pixel centres at whole numbers."""


def with_hole(photo: Photo, linear: Array, hole: Array, plan: Plan | None, label: Array) -> Photo:
    """The photo with a hole [H, W] bool filled by `linear` [H, W, 3], at native size with the detail of its sources.

    `label` [H, W] int: surfaces, in the hole and around it; they part along smooth lines at native size.
    """
    native, linear = photo.original.shape[:2], linear.astype(np.float32)
    if native == hole.shape:
        return replace(photo, linear=linear, original=np.where(hole[..., None], linear, photo.original))
    share, original = outline(hole, native), photo.original.copy()
    if share.any():
        surfaces = [_Surface.of(own, linear) for own in _surfaces(label, hole)]
        sources = _sources(plan, hole)
        box, columns = window(hole, native)
        for rows in strips(box.stop, start=box.start):
            part = (rows, columns)
            picture = np.maximum(_picture(photo, surfaces, sources, part), 0)
            original[part] = laid(picture, share[part], photo.original[part])
    return replace(photo, linear=linear, original=original)


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


def resized(picture: Array, shape: tuple[int, ...]) -> Array:
    """[h, w] or [h, w, C] at another size (rows, columns, ...), averaged when it shrinks."""
    import cv2

    if picture.shape[:2] == shape[:2]:
        return picture.copy()
    how = cv2.INTER_AREA if picture.shape[0] > shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(np.ascontiguousarray(picture, np.float32), shape[1::-1], interpolation=how))


@dataclass(frozen=True)
class _Surface:
    """One surface in a hole or at its rim, continued over the picture by its nearest pixels."""

    share: Array
    """[H, W] float32: where it is, with soft outlines."""
    nearest: tuple[Array, Array]
    """[H, W] int row and column of its nearest pixel."""
    picture: Array
    """[H, W, 3] the filled picture of that pixel."""

    @staticmethod
    def of(own: Array, linear: Array) -> _Surface:
        """From where it is, [H, W] bool."""
        import cv2
        from scipy.ndimage import distance_transform_edt

        row, column = distance_transform_edt(~own, return_distances=False, return_indices=True)
        share = np.asarray(cv2.GaussianBlur(own.astype(np.float32), (0, 0), SMOOTH))
        return _Surface(share, (row, column), linear[row, column])


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


def _sources(plan: Plan | None, hole: Array) -> Array | None:
    """[H, W, 2] rows and columns from each filled pixel to its source; NaN outside the hole."""
    if plan is None:
        return None
    shift = np.zeros((*hole.shape, 2), np.float32)
    width = hole.shape[1]
    shift[plan.rows, plan.columns] = np.stack(
        [plan.source // width - plan.rows, plan.source % width - plan.columns], -1
    )
    return np.where(hole[..., None], shift, np.nan)


def _picture(photo: Photo, surfaces: list[_Surface], sources: Array | None, box: tuple[slice, slice]) -> Array:
    """[h, w, 3] a native window of the filled picture: each surface by its share of the pixels."""
    native, working = photo.original.shape[:2], photo.linear.shape[:2]
    rows, columns = np.mgrid[box]
    places = _places(rows, columns, native, working)
    shares = np.stack([_sampled(surface.share, places) for surface in surfaces]) ** 8  # over about a pixel
    shares /= np.maximum(shares.sum(0), 1e-30)
    own = tuple(np.clip(np.round(v), 0, n - 1).astype(int) for v, n in zip(places[::-1], working))
    picture = np.zeros((*rows.shape, 3), np.float32)
    for surface, share in zip(surfaces, shares):
        if not share.any():
            continue
        one = _sampled(surface.picture, places)
        if sources is not None:
            moved = sources[surface.nearest[0][own], surface.nearest[1][own]]
            known = np.isfinite(moved[..., 0])
            at = [
                np.clip(
                    v + np.round(np.nan_to_num(moved[..., k]) * native[k] / working[k]).astype(int), 0, native[k] - 1
                )
                for k, v in enumerate((rows, columns))
            ]
            detail = photo.original[at[0], at[1]] - _sampled(photo.linear, _places(at[0], at[1], native, working))
            one = one + np.where(known[..., None], detail, 0)
        picture += share[..., None] * one
    return picture


def _places(rows: Array, columns: Array, native: tuple[int, ...], working: tuple[int, ...]) -> Places:
    """The places of native pixels."""
    y, x = (((v + 0.5) * w / n - 0.5).astype(np.float32) for v, w, n in zip((rows, columns), working, native))
    return x, y


def _sampled(maps: Array, places: Places) -> Array:
    """Maps [H, W] or [H, W, C] at places, linearly."""
    import cv2

    values = np.ascontiguousarray(maps, np.float32)
    return np.asarray(cv2.remap(values, *places, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
