"""Parts of a selected object: what has the material of a click, and what one more click takes away."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from skimage.morphology import remove_small_holes, remove_small_objects

from materialist.color import linear_to_srgb
from materialist.edits.select.objects import object_at_points
from materialist.errors import InputError
from materialist.geometry.silhouette import disc
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SelectionPartSettings:
    """What is of one material; tuned by eye on 14 clicks; colours in CIELAB of the albedo.

    `lightness` and `threshold` were chosen on half of the materials of `bench select`.
    """

    seed_radius: float = 0.02  # of what is surely of the material, around a click; in longer sides
    lightness: float = 0.35  # weight of L beside a and b: what light is left in the albedo is in L
    spread: float = 4.0  # least standard deviation of a material's colour
    sure: float = 2.0  # standard deviations within which a pixel tells more of the material
    rounds: int = 3  # in which it does
    threshold: float = 3.5  # standard deviations within which a pixel is of the material
    crumbs: float = 0.003  # shares of the selection below which holes and pieces are none

    piece: float = 14.0  # from the colour of a pixel, in each of L, a and b: still its piece
    most: float = 0.75  # of a selection, that a click can take away


SETTINGS = SelectionPartSettings()
_FILTER = (7, 8.0, 3.0)
"""Diameter, standard deviation of colours and of places, pixels, of the bilateral filter of the albedo."""


def of_material(albedo: Array, mask: Array, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] bool: what of a mask has the material that it has at one of the points (column, row).

    albedo: [H, W, 3] linear. mask: [H, W] bool. Seen is the albedo, so that a shadow is no other material.
    """
    colour = _lab(albedo) * np.array([SETTINGS.lightness, 1, 1], np.float32)
    colour = cv2.bilateralFilter(colour, *_FILTER)
    distance = np.min([_distance(colour, mask, point) for point in points], axis=0)
    alike = mask & (distance < SETTINGS.threshold)
    size = int(SETTINGS.crumbs * alike.sum())
    alike = remove_small_objects(remove_small_holes(alike, max_size=size), max_size=size)
    # Pixels of a border are mixed with what is beyond: lines of another colour stay.
    other = cv2.morphologyEx((mask & ~alike).astype(np.uint8), cv2.MORPH_OPEN, disc(1)) > 0
    return mask & ~other


def _distance(colour: Array, mask: Array, point: tuple[int, int]) -> Array:
    """[H, W] standard deviations from the colours of the material at a point (column, row) of a mask [H, W] bool."""
    rows, columns = np.indices(mask.shape)
    near = np.hypot(columns - point[0], rows - point[1]) < SETTINGS.seed_radius * max(mask.shape)
    members = mask & near
    members[point[1], point[0]] = True
    # The material is seen around the click first, then wherever it surely is.
    for _ in range(SETTINGS.rounds):
        middle = np.median(colour[members], axis=0)
        spread = np.sqrt(colour[members].var(0) + SETTINGS.spread**2)
        distance = np.sqrt((((colour - middle) / spread) ** 2).sum(-1))
        members = mask & (distance < SETTINGS.sure)
    return cv2.GaussianBlur(distance.astype(np.float32), (0, 0), 1)


def without(
    scene: Scene, mask: Array, point: tuple[int, int], keep: Sequence[tuple[int, int]] = ()
) -> Array:
    """[H, W] bool: a mask less the object at a point (column, row) of it.

    Where that is most of the mask, or holds a point of `keep`, what is of one colour there is taken away instead.
    Raises InputError where that is, too.
    """
    for region in (_object, _piece):
        gone = region(scene, mask, point)
        kept = any(gone[y, x] for x, y in keep)
        if gone.any() and not kept and gone.sum() < SETTINGS.most * mask.sum():
            return mask & ~gone
    raise InputError(
        f"What is at {point[0]},{point[1]} cannot be told from the rest of the selection; "
        "click another place, or give a mask."
    )


def _object(scene: Scene, mask: Array, point: tuple[int, int]) -> Array:
    """[H, W] bool: what of a mask is of the smallest object at a point (column, row)."""
    try:
        return mask & object_at_points(scene, [point], extent="small")
    except InputError:  # the network sees none there
        return np.zeros_like(mask)


def _piece(scene: Scene, mask: Array, point: tuple[int, int]) -> Array:
    """[H, W] bool: what is of one colour with a pixel (column, row) of a mask, and joined to it within that."""
    # By the albedo: a shadow is no border.
    colour = cv2.bilateralFilter(_lab(scene.materials.albedo), 5, 10, 3)
    barred = np.pad(np.where(mask, 0, 1).astype(np.uint8), 1, constant_values=1)
    flags = 4 | cv2.FLOODFILL_FIXED_RANGE | cv2.FLOODFILL_MASK_ONLY | (2 << 8)
    around = (SETTINGS.piece,) * 3
    cv2.floodFill(colour, barred, point, (0, 0, 0), around, around, flags)
    piece = (barred[1:-1, 1:-1] == 2).astype(np.uint8)
    # Specks that are left between belong to it.
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
    return (cv2.morphologyEx(piece, cv2.MORPH_CLOSE, kernel) > 0) & mask


def _lab(albedo: Array) -> Array:
    """[H, W, 3] float32 CIELAB of a linear albedo: differences are those that the eye sees."""
    encoded = linear_to_srgb(np.clip(albedo, 0, 1)).astype(np.float32)
    return np.asarray(cv2.cvtColor(encoded, cv2.COLOR_RGB2LAB))
