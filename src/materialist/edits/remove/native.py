"""A hole filled at working size, at the photo's native size with the detail of its sources."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.edits.composite.upsample import strips
from materialist.geometry.silhouette import window
from materialist.types import Array, Photo


def with_hole(photo: Photo, linear: Array, hole: Array, source: Array | None) -> Photo:
    """The photo with a hole [H, W] bool filled by `linear` [H, W, 3], at native size with the detail of its sources.

    `source` [H, W] int: row-major source of each pixel, None where nothing is copied.
    """
    native, linear = photo.original.shape[:2], linear.astype(np.float32)
    if native == hole.shape:
        return replace(photo, linear=linear, original=np.where(hole[..., None], linear, photo.original))
    share, original = outline(hole, native), photo.original.copy()
    box, columns = window(hole, native)
    for rows in strips(box.stop, start=box.start):
        part = (rows, columns)
        picture = np.maximum(_enlarged(photo, linear, source, np.mgrid[part]), 0)
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
    smooth = cv2.GaussianBlur(mask.astype(np.float32), (0, 0), 1.0)
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


def _enlarged(photo: Photo, linear: Array, source: Array | None, pixels: Array) -> Array:
    """[h, w, 3] `linear` at native `pixels` [2, h, w], with what the photo has beyond working size at their sources."""
    working, native = np.array(linear.shape[:2]), np.array(photo.original.shape[:2])
    picture = _sampled(linear, pixels, native)
    if source is None:
        return picture
    own = tuple(np.minimum((v * w) // n, w - 1) for v, w, n in zip(pixels, working, native))
    shifts = np.stack(np.divmod(source[own], working[1])) - np.stack(own)
    limits = native[:, None, None] - 1
    at = np.clip(pixels + np.round(shifts * (native / working)[:, None, None]).astype(int), 0, limits)
    return picture + photo.original[at[0], at[1]] - _sampled(photo.linear, at, native)


def _sampled(values: Array, pixels: Array, native: Array) -> Array:
    """[h, w, 3] a working picture [H, W, 3] at native pixels [2, h, w], linearly."""
    import cv2

    y, x = (((v + 0.5) * w / n - 0.5).astype(np.float32) for v, w, n in zip(pixels, values.shape, native))
    return np.asarray(cv2.remap(np.ascontiguousarray(values), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))
