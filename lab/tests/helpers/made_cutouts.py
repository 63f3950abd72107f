"""A picture of a thing cut out."""

from pathlib import Path

import numpy as np
from PIL import Image


def write_disc(path: Path, size: int = 80, margin: int = 10) -> None:
    """A red disc with a transparent margin, `size` pixels with it."""
    rows, columns = np.indices((size, size)) - (size - 1) / 2
    inside = np.hypot(rows, columns) < size / 2 - margin
    pixels = np.zeros((size, size, 4), np.uint8)
    pixels[inside] = 220, 30, 20, 255
    Image.fromarray(pixels).save(path)
