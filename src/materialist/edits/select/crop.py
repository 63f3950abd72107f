"""A part of a photo, finer than at working size, and where its pixels lie in the working picture."""

from dataclasses import dataclass

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import Box, window
from materialist.types import Array, Photo


@dataclass(frozen=True)
class Crop:
    """A part of a photo at its own resolution, or a little less."""

    picture: Array
    """[h, w, 3] sRGB in [0, 1]."""
    scale: Array
    """[2] its pixels for one working pixel, across and down."""
    origin: Array
    """[2] where its corner is in the working picture: column, row."""

    def within(self, places: Array) -> Array:
        """Places [..., 2] of the working picture, column and row, in this one."""
        return (places - self.origin) * self.scale

    def at_working_size(self, values: Array, box: Box) -> Array:
        """Values [h, w] of its pixels at the pixels of a box of the working picture."""
        rows, columns = box
        # A Gaussian as wide as a working pixel, of which the crop may have many.
        smooth = cv2.GaussianBlur(values, (0, 0), *(self.scale / np.sqrt(12)))
        # Pixel centres are half a pixel from the corners.
        corner = self.within(np.array([columns.start, rows.start]) + 0.5) - 0.5
        placing = np.column_stack([np.diag(self.scale), corner])
        return cv2.warpAffine(
            smooth,
            placing,
            (columns.stop - columns.start, rows.stop - rows.start),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )


def crop_around(photo: Photo, mask: Array, margin: int, side: int) -> Crop:
    """What is around a mask [H, W] bool, with `margin` working pixels more, at most `side` pixels long."""
    # --- Whole native pixels, no finer than is asked for ---
    native = photo.original.shape[:2]
    rows, columns = window(mask, native, margin)
    picture = photo.original[rows, columns]
    height, width = picture.shape[:2]
    reduced = min(side / max(height, width), 1)
    if reduced < 1:
        size = (max(1, round(reduced * width)), max(1, round(reduced * height)))
        picture = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    # --- A working pixel in pixels of the photo, and in those of the picture ---
    of_native = np.array([native[1] / mask.shape[1], native[0] / mask.shape[0]])
    kept = np.array([picture.shape[1] / width, picture.shape[0] / height])
    origin = np.array([columns.start, rows.start]) / of_native
    return Crop(linear_to_srgb(picture), of_native * kept, origin)
