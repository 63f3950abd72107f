"""Glare of lamps that the camera sees: a lens scatters a little of their light over the picture."""

import cv2
import numpy as np

from materialist.edits.composite.upsample import strips
from materialist.types import Array

WIDTHS = ((0.01, 0.002), (0.04, 0.003), (0.12, 0.001))
"""(standard deviation in longer sides, share of the light) of each Gaussian; tuned by eye on two lamps."""
LONGER_SIDE = 512
"""Pixels at which the light is blurred; derived: time and memory."""


def add_glare(picture: Array, light: Array, box: tuple[slice, slice]) -> None:
    """Add to a picture [H, W, 3] linear, in place, what a lens scatters of the light [h, w, 3] in a box of it."""
    height, width = picture.shape[:2]
    factor = min(1.0, LONGER_SIDE / max(height, width))
    scattered = _scattered(light, box, (height, width), factor)
    # --- Bilinear, strip by strip, which bounds the memory ---
    columns = ((np.arange(width) + 0.5) * factor - 0.5).astype(np.float32)
    for rows in strips(height):
        lines = ((np.arange(rows.start, rows.stop) + 0.5) * factor - 0.5).astype(np.float32)
        places = (columns[None], lines[:, None])
        x, y = (np.ascontiguousarray(v) for v in np.broadcast_arrays(*places))
        picture[rows] += cv2.remap(
            scattered, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
        )


def _scattered(
    light: Array, box: tuple[slice, slice], shape: tuple[int, int], factor: float
) -> Array:
    """[h, w, 3] the same at a smaller size, `factor` times the picture's shape."""
    height, width = (max(1, round(n * factor)) for n in shape)
    # --- The light in its place ---
    top, left = (
        min(round(side.start * factor), n - 1) for side, n in zip(box, (height, width), strict=True)
    )
    size = [max(1, round(n * factor)) for n in light.shape[1::-1]]
    small = np.asarray(cv2.resize(light, size, interpolation=cv2.INTER_AREA))
    small = small[: height - top, : width - left]
    canvas = np.zeros((height, width, 3), np.float32)
    canvas[top : top + small.shape[0], left : left + small.shape[1]] = small
    # --- Blurred; beyond the frame there is nothing ---
    scattered = np.zeros_like(canvas)
    for sigma, share in WIDTHS:
        pixels = sigma * max(height, width)
        scattered += np.float32(share) * cv2.GaussianBlur(
            canvas, (0, 0), pixels, borderType=cv2.BORDER_CONSTANT
        )
    return scattered
