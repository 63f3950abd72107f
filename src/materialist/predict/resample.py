"""Maps of one size brought to another, each by the rule that its meaning asks for."""

import cv2
import numpy as np

from materialist.types import Array

EDGE_RATIO = 1.1
"""Neighbouring depths further apart than this ratio are on two surfaces and are not mixed."""


def with_longer_side(size: tuple[int, ...], side: int) -> tuple[int, int]:
    """A size (height, width) with that longer side."""
    factor = side / max(size)
    return max(1, round(size[0] * factor)), max(1, round(size[1] * factor))


def values(array: Array, size: tuple[int, ...]) -> Array:
    """[H, W] or [H, W, 3] float32 brought to `size` (height, width): area means down, bilinear up."""
    shrinks = array.shape[0] > size[0] or array.shape[1] > size[1]
    return cv2.resize(
        array, size[::-1], interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    )


def normals(array: Array, size: tuple[int, int]) -> Array:
    """Unit vectors [H, W, 3] brought to `size`, of unit length again; zero (unknown) where most of the area is."""
    mixed = values(array, size)
    length = np.linalg.norm(mixed, axis=-1, keepdims=True)
    return np.where(length > 0.2, mixed / np.maximum(length, 1e-6), 0).astype(np.float32)


def depth(array: Array, size: tuple[int, int]) -> Array:
    """Planar depth [H, W] (0 = none) brought to `size` without new surfaces between near and far, or next to holes.

    On one surface inverse depth is interpolated (exact on planes); near edges and holes the nearest pixel is taken.
    """
    nearest = cv2.resize(array, size[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
    known = array > 0
    inverse = np.where(known, 1 / np.where(known, array, 1), 0).astype(np.float32)
    # A linear interpolation of inverse depth is exact on planes in perspective.
    smooth = 1 / np.maximum(values(inverse, size), 1e-12)
    # The neighbourhood that an area mean or a bilinear lookup may touch, at either size.
    reach = 2 * int(np.ceil(max(1.0, array.shape[0] / size[0], array.shape[1] / size[1]))) + 1
    kernel = np.ones((reach, reach), np.uint8)
    near = cv2.resize(
        cv2.dilate(inverse, kernel), size[::-1], interpolation=cv2.INTER_NEAREST_EXACT
    )
    far = cv2.resize(cv2.erode(inverse, kernel), size[::-1], interpolation=cv2.INTER_NEAREST_EXACT)
    return np.where((far > 0) & (near <= EDGE_RATIO * far), smooth, nearest).astype(np.float32)
