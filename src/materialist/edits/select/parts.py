"""What one more click takes away from a selected object."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from skimage.morphology import remove_small_objects

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import disc, window
from materialist.types import Array

Point = tuple[int, int]
"""(column, row)."""


@dataclass(frozen=True)
class SelectionPartSettings:
    """What a click takes away; tuned by eye on 14 clicks. Lengths are in longer sides."""

    gap: float = 0.004  # half of the width of lines that are slivers
    crumb: float = 0.003  # share of the selection, of pieces that go
    kept: float = 0.004  # radius around a click of what stays in any case
    piece: float = 14.0  # from the colour of a pixel, in each of L, a and b: still its piece
    most: float = 0.75  # share of a selection that a click can take away


SETTINGS = SelectionPartSettings()


def without(
    albedo: Array,
    mask: Array,
    point: Point,
    part: Array | None,
    keep: Sequence[Point] = (),
) -> Array | None:
    """[H, W] bool: a mask less what is at a point of it: the part there, or what is of one colour with the point.

    part: [H, W] bool, or None where no part is known there. What is most of the mask, or holds a point of `keep`, is
    not meant; None where nothing else is there.
    """

    def is_meant(gone: Array) -> bool:
        few = (mask & gone).sum() < SETTINGS.most * mask.sum()
        return bool(few and gone[point[1], point[0]]) and not any(gone[y, x] for x, y in keep)

    gone = part if part is not None and is_meant(part) else piece_at(albedo, mask, point)
    return _without_slivers(mask & ~gone, gone, keep) if is_meant(gone) else None


def _without_slivers(mask: Array, gone: Array, keep: Sequence[Point]) -> Array:
    """[H, W] bool: a mask without what is thin or small beside what is gone; what is around a point of `keep` stays."""
    longer = max(mask.shape)
    size = int(SETTINGS.crumb * mask.sum())
    thick = remove_small_objects(opened(mask), max_size=size)
    # The corners that opening rounds off come back, and so does what lies elsewhere.
    whole = cv2.dilate(thick.astype(np.uint8), _disc(longer)) > 0
    beside = cv2.dilate(gone.astype(np.uint8), _disc(longer), iterations=3) > 0
    result = mask & (whole | ~beside)
    for point in keep:
        result |= mask & around(mask.shape, point, SETTINGS.kept * longer)
    return result


def piece_at(albedo: Array, mask: Array, point: Point) -> Array:
    """[H, W] bool: what is of one colour with a pixel of a mask [H, W] bool, and joined to it within that."""
    box = window(mask)
    colour = cv2.bilateralFilter(lab(albedo[box]), 5, 10, 3)
    start = (int(point[0] - box[1].start), int(point[1] - box[0].start))
    # The flood is bounded by 1, and writes 2; its mask is a pixel larger on each side.
    flood = np.pad((~mask[box]).astype(np.uint8), 1, constant_values=1)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    tolerance = (SETTINGS.piece,) * 3
    cv2.floodFill(colour, flood, start, (0, 0, 0), tolerance, tolerance, flags)
    piece = np.zeros_like(mask)
    piece[box] = flood[1:-1, 1:-1] == 2
    # Specks that are left between belong to it.
    closed = cv2.morphologyEx(piece.astype(np.uint8), cv2.MORPH_CLOSE, _disc(max(mask.shape)))
    return (closed > 0) & mask


def opened(mask: Array) -> Array:
    """[H, W] bool: a mask [H, W] bool without lines thinner than `gap`."""
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _disc(max(mask.shape))) > 0


def around(shape: tuple[int, ...], point: Point, radius: float) -> Array:
    """[H, W] bool: within a radius, pixels, of a point."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((columns - point[0]) ** 2 + (rows - point[1]) ** 2 < max(radius, 1) ** 2)


def _disc(longer: int) -> Array:
    return disc(max(1, round(SETTINGS.gap * longer)))


def lab(albedo: Array) -> Array:
    """[H, W, 3] float32 CIELAB of a linear albedo: differences are those that the eye sees."""
    encoded = linear_to_srgb(np.clip(albedo, 0, 1)).astype(np.float32)
    return np.asarray(cv2.cvtColor(encoded, cv2.COLOR_RGB2LAB))
