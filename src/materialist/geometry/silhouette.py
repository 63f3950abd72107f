"""The silhouette of one object in a picture: its pixels, their distance to it, the object's size."""

import cv2
import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter

from materialist.errors import InputError
from materialist.types import Array, Camera

Box = tuple[slice, slice]
"""Rows and columns of a part of a picture."""


def surface_in(mask: Array, depth: Array, camera: Camera) -> Array:
    """[H, W] bool: pixels of the mask that have a surface. Raises InputError for other sizes or when none is left."""
    size = (camera.height, camera.width)
    if np.shape(mask) != size or np.shape(depth) != size:
        raise InputError(
            f"The mask is {np.shape(mask)} and the depth {np.shape(depth)}; the camera needs {size}."
        )
    inside = (np.asarray(mask) > 0.5) & (np.asarray(depth) > 0)
    if not inside.any():
        raise InputError("The mask covers no surface; mark an object.")
    return inside


def window(mask: Array, native: tuple[int, ...] | None = None, margin: int = 0) -> Box:
    """Rows and columns of the pixels of a mask [H, W] bool that is not empty, and of `margin` around them.

    native: size of a larger picture whose rows and columns they are; None: those of the mask.
    """
    sides = []
    for axis in (0, 1):
        where = np.flatnonzero(mask.any(1 - axis))
        count = mask.shape[axis]
        first = max(where[0] - margin, 0)
        last = min(where[-1] + 1 + margin, count)
        size = (native or mask.shape)[axis]
        sides.append(slice(int(first * size // count), int(-(-last * size // count))))
    return sides[0], sides[1]


def area(box: Box) -> int:
    """Pixels of a window."""
    return max(box[0].stop - box[0].start, 0) * max(box[1].stop - box[1].start, 0)


def common(first: Box, second: Box) -> Box:
    """The part of a picture that is in both windows; of area 0 where there is none."""
    rows, columns = (
        slice(max(a.start, b.start), min(a.stop, b.stop)) for a, b in zip(first, second)
    )
    return rows, columns


def within(part: Box, box: Box) -> Box:
    """A part of a picture, as rows and columns of a window that holds it."""
    rows, columns = (
        slice(a.start - b.start, a.stop - b.start) for a, b in zip(part, box, strict=True)
    )
    return rows, columns


def disc(radius: int) -> Array:
    """[2 r + 1, 2 r + 1] uint8: the pixels within a radius, for `cv2.erode` and its like."""
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1,) * 2))


def grown(mask: Array, radius: int) -> Array:
    """[H, W] bool: a mask grown by a disc of `radius` pixels."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), disc(radius)) > 0)


def border_distance(inside: Array) -> Array:
    """[H, W] pixels from each pixel's centre to the silhouette, 0 outside; the picture's border is no silhouette."""
    # An object that the border cuts goes on beyond it.
    padded = np.pad(inside, 1, mode="edge")
    if padded.all():
        padded = np.pad(inside, 1)
    return np.where(inside, np.maximum(distance_transform_edt(padded)[1:-1, 1:-1] - 0.5, 0.5), 0)


def silhouette_field(inside: Array) -> Array:
    """[H, W] pixels to the silhouette, > 0 inside: the pixels' stairs are smoothed, straight edges keep their place."""
    framed = np.pad(inside, 1)
    signed = distance_transform_edt(framed) - distance_transform_edt(~framed)
    signed = signed - 0.5 * np.sign(
        signed
    )  # pixel centres lie half a pixel from the border between pixels
    return gaussian_filter(np.clip(signed, -6, 6), 0.8)[1:-1, 1:-1]


def spacing(rays: Array) -> float:
    """Distance of neighbouring rays [H, W, 3] at z = -1: one over the focal length in pixels."""
    last = rays.shape[1] - 1
    return float(rays[0, last, 0] - rays[0, 0, 0]) / last if last else 1.0


def object_size(inside: Array, depth: Array, rays: Array) -> float:
    """The square root of the area of the mask [H, W] bool at its median depth, scene units."""
    return float(np.sqrt(inside.sum()) * np.median(depth[inside]) * spacing(rays))
