"""Parts of a region, as MobileSAM outlines them: the one at a click, and those of one material by their colours."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from skimage.color import deltaE_ciede94
from skimage.morphology import remove_small_holes, remove_small_objects

from materialist.color import linear_to_srgb
from materialist.edits.select.parts import Point, around, lab, opened
from materialist.geometry.silhouette import window
from materialist.predict.sam import masks as sam
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SameMaterialSettings:
    """What is of one material. Lengths are in longer sides.

    Threshold, weights and the number of places were compared on the materials of `bench select` and 13 clicks of
    photos: 6.5 to 7.5, 0.7 to 0.9 and 4 to 16 places differ by 0.02 of IoU.
    """

    places: int = 6  # beside the clicks, at which parts are outlined
    min_expected: float = 0.9  # IoU that MobileSAM expects of an outline
    min_inside: float = 0.8  # share of an outline in the region
    min_size: float = 0.003  # share of the region
    part_weight: float = 0.85  # of a part's colour beside a pixel's own
    lightness: float = 3.0  # by which CIE94 divides it: what light is left in the albedo is in L
    threshold: float = 7.0  # CIE94 difference
    seed_radius: float = 0.02  # of what is of the material around a click
    hole: float = 0.02  # share of the material, of holes that stay
    crumb: float = 0.003  # the same, of pieces that go
    kept: float = 0.004  # radius around a click of what stays in any case


SETTINGS = SameMaterialSettings()
OUTSIDE, IN_NO_PART = 0, 1
"""The first labels of `parts_of`."""


def of_material(
    scene: Scene, mask: Array, points: Sequence[Point], *, network: bool = True
) -> Array:
    """[H, W] bool: what of a mask [H, W] bool has the material that it has at one of the points on it.

    A part is of the material as a whole, with its highlights and shades, unless they differ very much. Without the
    network each pixel goes by its own colour.
    Raises SetupError, WeightsError: see `predict.onnx.run`.
    """
    longer = max(mask.shape)
    labels = parts_of(scene, mask, points) if network else mask.astype(int)
    # --- What has the colour of one of the clicks ---
    colour = lab(scene.materials.albedo)
    distance = np.min([_distance(colour, labels, point) for point in points], axis=0)
    alike = mask & (distance < SETTINGS.threshold)
    # --- Without specks on either side ---
    size = int(alike.sum())
    alike = remove_small_holes(alike, max_size=int(SETTINGS.hole * size))
    alike = remove_small_objects(alike, max_size=int(SETTINGS.crumb * size))
    near = [around(mask.shape, point, SETTINGS.kept * longer) for point in points]
    return np.asarray(mask & (~opened(mask & ~alike) | np.logical_or.reduce(near)))


def part_at(scene: Scene, mask: Array, point: Point) -> Array | None:
    """[H, W] bool of the smallest part around a point of a mask [H, W] bool; None where none is outlined.

    Raises SetupError, WeightsError: see `predict.onnx.run`.
    """
    labels = parts_of(scene, mask, [point])
    label = labels[point[1], point[0]]
    return None if label == IN_NO_PART else np.asarray(labels == label)


def parts_of(scene: Scene, mask: Array, points: Sequence[Point]) -> Array:
    """[H, W] int labels: the smallest part around each pixel of a mask [H, W] bool.

    MobileSAM outlines parts at the points, (column, row), and at places of the mask that lie far from each other.
    Raises SetupError, WeightsError: see `predict.onnx.run`.
    """
    photo = linear_to_srgb(scene.photo.linear)
    outlines = []
    for place in [*points, *_places(mask, SETTINGS.places)]:
        logits, expected = sam.masks(photo, [place])
        sure = logits[expected >= SETTINGS.min_expected] > 0
        outlines += [outline & mask for outline in sure if _is_part(outline, mask)]
    labels = np.where(mask, IN_NO_PART, OUTSIDE)
    # Smaller ones come last, over those that hold them.
    by_size = sorted(outlines, key=np.sum, reverse=True)
    for label, outline in enumerate(by_size, IN_NO_PART + 1):
        labels[outline] = label
    return labels


def _is_part(outline: Array, mask: Array) -> bool:
    """Whether an outline [H, W] bool lies in the mask and is no speck of it."""
    inside = int((outline & mask).sum())
    return bool(
        inside >= SETTINGS.min_inside * outline.sum() and inside > SETTINGS.min_size * mask.sum()
    )


def _places(mask: Array, count: int) -> list[Point]:
    """(column, row) of up to `count` places of a mask [H, W] bool, far from its border and from each other."""
    box = window(mask)
    room = ndimage.distance_transform_edt(np.pad(mask[box], 1))[1:-1, 1:-1]
    rows, columns = np.indices(room.shape)
    places: list[Point] = []
    while len(places) < count and room.max() > 1:
        row, column = np.unravel_index(int(room.argmax()), room.shape)
        places.append((int(column) + box[1].start, int(row) + box[0].start))
        room = np.minimum(room, np.hypot(rows - row, columns - column) / 2)
    return places


def _distance(colour: Array, labels: Array, point: Point) -> Array:
    """[H, W] CIE94 difference of CIELAB colours [H, W, 3] from the material at a point, partly of whole parts.

    The material is seen around the point and in all of its part; the less different one counts.
    """
    column, row = point
    near = around(labels.shape, point, SETTINGS.seed_radius * max(labels.shape))
    seen = [near & (labels != OUTSIDE)]
    if labels[row, column] != IN_NO_PART:
        seen.append(labels == labels[row, column])
    differences = [_difference(colour, labels, np.median(colour[one], axis=0)) for one in seen]
    return np.minimum.reduce(differences)


def _difference(colour: Array, labels: Array, reference: Array) -> Array:
    """[H, W] CIE94 difference of colours [H, W, 3] from a reference [3], partly of whole parts."""
    pixels = deltaE_ciede94(np.broadcast_to(reference, colour.shape), colour, kL=SETTINGS.lightness)
    pixels = ndimage.gaussian_filter(pixels, 1)
    parts = ndimage.median(pixels, labels, np.arange(labels.max() + 1))[labels]
    mixed = pixels + SETTINGS.part_weight * (parts - pixels)
    return np.where(labels == IN_NO_PART, pixels, mixed)
