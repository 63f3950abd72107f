"""Parts of a selected object: what has the material of a click, and what one more click takes away."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from skimage.morphology import remove_small_holes, remove_small_objects

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import disc, window
from materialist.types import Array

Point = tuple[int, int]
"""(column, row)."""


@dataclass(frozen=True)
class SelectionPartSettings:
    """What is of one material, by its CIELAB albedo; tuned by eye on 14 clicks.

    Lightness, threshold, gaps and crumbs were chosen on half of the materials of `bench select`. Lengths are in longer
    sides.
    """

    seed_radius: float = 0.02  # of what is of the material, around a click
    lightness: float = 0.35  # weight of L beside a and b: what light is left in the albedo is in L
    spread: float = 4.0  # least standard deviation of a material's colour
    sure: float = 2.0  # standard deviations within which a pixel tells more of the material
    rounds: int = 3  # in which it does
    threshold: float = 3.5  # standard deviations within which a pixel is of the material
    gap: float = 0.004  # half of the width of lines of another colour that stay: seams and folds
    hole: float = 0.02  # share of the material, of holes that stay: highlights
    crumb: float = 0.003  # the same, of pieces that go
    kept: float = 0.004  # radius around a click of what stays in any case

    piece: float = 14.0  # from the colour of a pixel, in each of L, a and b: still its piece
    most: float = 0.75  # share of a selection that a click can take away


SETTINGS = SelectionPartSettings()


def of_material(albedo: Array, mask: Array, points: Sequence[Point]) -> Array:
    """[H, W] bool: what of a mask has the material that it has at one of the points on it.

    albedo: [H, W, 3] linear, in which soft shadows are gone. mask: [H, W] bool.
    """
    # --- Only the part of the picture around the mask ---
    box = window(mask)
    inside = mask[box]
    places = [(x - box[1].start, y - box[0].start) for x, y in points]
    longer = max(mask.shape)
    # --- What has the colour of one of the clicks ---
    weights = np.array([SETTINGS.lightness, 1, 1], np.float32)
    colour = cv2.bilateralFilter(_lab(albedo[box]) * weights, 7, 8, 3)
    distance = np.min([_distance(colour, inside, place, longer) for place in places], axis=0)
    alike = inside & (distance < SETTINGS.threshold)
    # --- Without specks on either side ---
    size = int(alike.sum())
    alike = remove_small_holes(alike, max_size=int(SETTINGS.hole * size))
    alike = remove_small_objects(alike, max_size=int(SETTINGS.crumb * size))
    other = cv2.morphologyEx((inside & ~alike).astype(np.uint8), cv2.MORPH_OPEN, _disc(longer)) > 0
    near = [_near(inside.shape, place, SETTINGS.kept * longer) for place in places]
    result = np.zeros_like(mask)
    result[box] = inside & (~other | np.logical_or.reduce(near))
    return result


def _distance(colour: Array, mask: Array, point: Point, longer: int) -> Array:
    """[H, W] standard deviations of colours [H, W, 3] from those of the material at a point of a mask [H, W] bool."""
    members = mask & _near(mask.shape, point, SETTINGS.seed_radius * longer)
    # The material is seen around the click first, then wherever it surely is.
    for _ in range(SETTINGS.rounds):
        members[point[1], point[0]] = True
        middle = np.median(colour[members], axis=0)
        spread = np.sqrt(colour[members].var(0) + SETTINGS.spread**2)
        distance = np.sqrt((((colour - middle) / spread) ** 2).sum(-1))
        members = mask & (distance < SETTINGS.sure)
    return cv2.GaussianBlur(distance.astype(np.float32), (0, 0), 1)


def without(
    albedo: Array,
    mask: Array,
    point: Point,
    thing: Array | None,
    keep: Sequence[Point] = (),
) -> Array | None:
    """[H, W] bool: a mask less what is at a point of it: the thing there, or what is of one colour with the point.

    thing: [H, W] bool, or None where no thing is known there. What is most of the mask, or holds a point of `keep`, is
    not meant; None where nothing else is there.
    """

    def is_meant(gone: Array) -> bool:
        few = (mask & gone).sum() < SETTINGS.most * mask.sum()
        return bool(few and gone[point[1], point[0]]) and not any(gone[y, x] for x, y in keep)

    gone = thing if thing is not None and is_meant(thing) else piece_at(albedo, mask, point)
    return _without_slivers(mask & ~gone, gone, keep) if is_meant(gone) else None


def _without_slivers(mask: Array, gone: Array, keep: Sequence[Point]) -> Array:
    """[H, W] bool: a mask without what is thin or small beside what is gone; what is around a point of `keep` stays."""
    longer = max(mask.shape)
    size = int(SETTINGS.crumb * mask.sum())
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, _disc(longer))
    opened = remove_small_objects(opened > 0, max_size=size)
    # The corners that opening rounds off come back, and so does what lies elsewhere.
    whole = cv2.dilate(opened.astype(np.uint8), _disc(longer)) > 0
    beside = cv2.dilate(gone.astype(np.uint8), _disc(longer), iterations=3) > 0
    result = mask & (whole | ~beside)
    for point in keep:
        result |= mask & _near(mask.shape, point, SETTINGS.kept * longer)
    return result


def piece_at(albedo: Array, mask: Array, point: Point) -> Array:
    """[H, W] bool: what is of one colour with a pixel of a mask [H, W] bool, and joined to it within that."""
    box = window(mask)
    colour = cv2.bilateralFilter(_lab(albedo[box]), 5, 10, 3)
    start = (int(point[0] - box[1].start), int(point[1] - box[0].start))
    # The flood is bounded by 1, and writes 2; its mask is a pixel larger on each side.
    flood = np.pad((~mask[box]).astype(np.uint8), 1, constant_values=1)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    around = (SETTINGS.piece,) * 3
    cv2.floodFill(colour, flood, start, (0, 0, 0), around, around, flags)
    piece = np.zeros_like(mask)
    piece[box] = flood[1:-1, 1:-1] == 2
    # Specks that are left between belong to it.
    closed = cv2.morphologyEx(piece.astype(np.uint8), cv2.MORPH_CLOSE, _disc(max(mask.shape)))
    return (closed > 0) & mask


def _near(shape: tuple[int, ...], point: Point, radius: float) -> Array:
    """[H, W] bool: within a radius, pixels, of a point."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    return np.asarray((columns - point[0]) ** 2 + (rows - point[1]) ** 2 < max(radius, 1) ** 2)


def _disc(longer: int) -> Array:
    return disc(max(1, round(SETTINGS.gap * longer)))


def _lab(albedo: Array) -> Array:
    """[H, W, 3] float32 CIELAB of a linear albedo: differences are those that the eye sees."""
    encoded = linear_to_srgb(np.clip(albedo, 0, 1)).astype(np.float32)
    return np.asarray(cv2.cvtColor(encoded, cv2.COLOR_RGB2LAB))
