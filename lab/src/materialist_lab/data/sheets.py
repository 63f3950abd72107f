"""Sheets of pictures: a photo and its maps side by side, the next below it."""

from pathlib import Path

import cv2
import numpy as np

from materialist.color import srgb_levels
from materialist.io.atomic import write_whole
from materialist.io.display import encoded, maps
from materialist.types import Array, Prediction

_SIDE = 144
"""Pixels of a picture's longer side in a sheet."""


def strip(image: Array, *predictions: Prediction) -> Array:
    """The linear picture and, under each other, the maps of each prediction: one row of a sheet, uint8 RGB."""
    rows = [np.concatenate([srgb_levels(image), *maps(p).values()], 1) for p in predictions]
    joined = np.concatenate(rows, 0)
    scale = _SIDE / max(image.shape[:2])
    size = (max(1, round(joined.shape[1] * scale)), max(1, round(joined.shape[0] * scale)))
    return cv2.resize(joined, size, interpolation=cv2.INTER_AREA)


def write_sheet(strips: list[Array], path: Path) -> None:
    """Strips under each other as a PNG, written whole or not at all."""
    if not strips:
        return
    wide = max(s.shape[1] for s in strips)
    padded = [np.pad(s, ((0, 6), (0, wide - s.shape[1]), (0, 0))) for s in strips]
    write_whole(path, encoded(np.concatenate(padded, 0)))
