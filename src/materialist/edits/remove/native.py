"""A picture in a hole of the photo, at working and at native size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from materialist.geometry.silhouette import window
from materialist.types import Array, Photo


def with_hole(photo: Photo, picture: Array, hole: Array) -> Photo:
    """The photo with a picture [h, w, 3] linear of any size in the hole [H, W] bool; elsewhere bit for bit itself."""
    original, share = photo.original.copy(), outline(hole, photo.original.shape[:2])
    box = window(hole, share.shape)
    over, large = share[box][..., None], resized(picture, share.shape)[box]
    original[box] = np.where(over > 0, over * large + (1 - over) * original[box], original[box])
    linear = np.where(hole[..., None], resized(picture, hole.shape), photo.linear).astype(np.float32)
    return replace(photo, linear=linear, original=original)


def outline(mask: Array, native: tuple[int, ...]) -> Array:
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
