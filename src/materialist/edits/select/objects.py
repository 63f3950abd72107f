"""The object at clicks or in a box: by MobileSAM and ClickNet, or by GrabCut (Rother et al. 2004)."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage
from skimage.morphology import remove_small_holes

from materialist.color import linear_to_srgb
from materialist.edits.select.crop import crop_around
from materialist.errors import InputError
from materialist.geometry.silhouette import disc, window
from materialist.predict.bundled.edges import grabcut
from materialist.predict.clicks import segment
from materialist.predict.clicks.features import Box
from materialist.predict.sam import masks as sam
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SelectSettings:
    """How an object is chosen; lengths in longer sides; tuned by eye unless said otherwise."""

    min_box_overlap: float = 0.25  # IoU of the object's box with the given one; less: misplaced
    gap: float = 0.015  # half of the gap across which two parts are one
    # share of the photo: a larger mask of several clicks needs one that alone selects half of it
    most: float = 0.5

    # GrabCut: radii around a click; tuned on 54 clicks.
    core_radius: float = 0.01  # certainly of the object
    probable_radius: float = 0.08  # taken for the object at first
    max_radius: float = 0.24  # beyond, GrabCut does not look

    min_held: float = 0.8  # of a click's mask, by the mask of its box that replaces it

    # The second look, at the object alone.
    margin: float = 0.2  # around its box, in longer sides of the box
    min_margin: int = 8  # the same in pixels
    min_enlargement: float = 1.25  # what fills the photo is not seen better; derived
    min_agreement: float = 0.8  # IoU with the first mask; less: another object

    clicknet_weight: float = (
        0.5  # of ClickNet beside MobileSAM; 0.25 to 2 score alike on 222 made things
    )


SETTINGS = SelectSettings()
EXTENTS = ("auto", "small", "medium", "large")
"""Which of MobileSAM's masks at a click is meant; `auto`: the likeliest."""


def object_at_points(
    scene: Scene,
    points: Sequence[tuple[int, int]],
    *,
    network: bool = True,
    extent: str = "auto",
    sharpen: bool = True,
) -> Array:
    """[H, W] bool of the object that all (column, row) points lie on: it holds them all.

    extent: one of `EXTENTS`, of the network's masks. sharpen: whether the network looks at it twice.
    Raises InputError where the network finds no such object, or where most of the photo is the smallest one.
    """
    if network:
        outline = _whole(scene, _together(scene, points, extent), points)
        outline = _sharpened(scene, outline, points) if sharpen else outline
        return tidy(outline > 0, points)
    return tidy(grabcut(scene.photo.linear, _around(scene, points)), points)


def object_in(scene: Scene, box: Box, *, network: bool = True, sharpen: bool = True) -> Array:
    """[H, W] bool of the object in a box, which may be small in it (`box_overlap`) or empty.

    GrabCut takes for the object what is not seen outside of the box: a tight box suits it.
    """
    inside = np.zeros(scene.depth.shape, np.uint8)
    inside[box[1] : box[3], box[0] : box[2]] = 1
    if network:
        outline = _outlined(scene, box)
        outline = _sharpened(scene, outline) if sharpen else outline
        return tidy((outline > 0) & (inside > 0), ())
    return tidy(grabcut(scene.photo.linear, inside * np.uint8(cv2.GC_PR_FGD)), ())


def box_overlap(mask: Array, box: Box) -> float:
    """Intersection over union of the bounding box of a mask [H, W] bool with a box; 0 for an empty mask."""
    if not mask.any():
        return 0.0
    object_box = np.zeros(mask.shape, bool)
    given_box = np.zeros(mask.shape, bool)
    object_box[window(mask)] = True
    given_box[box[1] : box[3], box[0] : box[2]] = True
    return overlap(object_box, given_box)


def _around(scene: Scene, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] uint8 labels for GrabCut: discs around the clicks."""
    label = np.zeros(scene.depth.shape, np.uint8)
    shares = (SETTINGS.max_radius, SETTINGS.probable_radius, SETTINGS.core_radius)
    for share, value in zip(shares, (cv2.GC_PR_BGD, cv2.GC_PR_FGD, cv2.GC_FGD), strict=True):
        for x, y in points:
            cv2.circle(label, (int(x), int(y)), max(2, round(share * max(label.shape))), value, -1)
    return label


def _together(scene: Scene, points: Sequence[tuple[int, int]], extent: str) -> Array:
    """[H, W] logits of the mask at all points. Raises InputError where a stray click makes it most of the photo."""
    outline = _at(scene, points, extent)
    share = (outline > 0).mean()
    if len(points) > 1 and extent == "auto" and share > SETTINGS.most:
        largest = max((_at(scene, [point]) > 0).mean() for point in points)
        if largest < share / 2:
            raise InputError(
                f"The clicks select {share:.0%} of the photo together, and each alone at most {largest:.0%}: one of "
                "them is off the object. Leave it out; where so much is meant, give a box or a mask."
            )
    return outline


def _at(scene: Scene, points: Sequence[tuple[int, int]], extent: str = "auto") -> Array:
    """[H, W] logits: of MobileSAM's masks that hold all points (column, row), the one that is meant.

    MobileSAM outlines parts and wholes well and guesses badly which of them is meant; ClickNet, which also sees normals
    and depth, outlines badly and guesses better.
    """
    photo = linear_to_srgb(scene.photo.linear)
    logits, expected = sam.masks(photo, points)
    columns, rows = np.transpose(points)
    holding = (logits[:, rows, columns] > 0).all(-1)
    if not holding.any():
        places = " and ".join(f"{x},{y}" for x, y in points)
        raise InputError(
            f"No object is found that holds the click at {places}; click another place on it, or give a box or a mask."
        )
    if extent != "auto":
        by_size = sorted(logits[holding], key=lambda one: (one > 0).sum())
        place = {"small": 0, "medium": len(by_size) // 2, "large": -1}
        return np.asarray(by_size[place[extent]])
    # Each mask by its expected IoU, and by how well it agrees with ClickNet.
    likely = segment.object_likelihood(photo, scene.normal, scene.depth, points)
    marks = [
        score + SETTINGS.clicknet_weight * _soft_overlap(likely, mask > 0)
        for mask, score in zip(logits, expected, strict=True)
    ]
    return np.asarray(logits[int(np.argmax(np.where(holding, marks, -np.inf)))])


def _whole(scene: Scene, outline: Array, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] logits: what MobileSAM outlines in the box of an outline, where that holds the outline and the points.

    In a box it outlines legs, rims and covers that it leaves out at a click.
    """
    mask = tidy(outline > 0, points)
    rows, columns = window(mask)
    whole = _outlined(scene, (columns.start, rows.start, columns.stop, rows.stop))
    holds = (whole[mask] > 0).sum() >= SETTINGS.min_held * mask.sum()
    return whole if holds and all(whole[y, x] > 0 for x, y in points) else outline


def _outlined(scene: Scene, box: Box) -> Array:
    """[H, W] logits: what MobileSAM thinks most of, in a box."""
    logits, expected = sam.masks(linear_to_srgb(scene.photo.linear), box=box)
    return np.asarray(logits[int(np.argmax(expected))])


def _sharpened(scene: Scene, outline: Array, points: Sequence[tuple[int, int]] = ()) -> Array:
    """[H, W] logits of an object, to which those of a second look at it are added: at what is around it alone.

    MobileSAM's masks have 256 pixels along the longer side, whatever it looks at. All points (column, row) stay in.
    """
    mask = tidy(outline > 0, points)
    if not mask.any():
        return outline
    # --- What is around the object, at the photo's own resolution ---
    rows, columns = window(mask)
    longer = max(rows.stop - rows.start, columns.stop - columns.start)
    margin = max(round(SETTINGS.margin * longer), SETTINGS.min_margin)
    around = window(mask, margin=margin)
    shape = mask[around].shape
    if SETTINGS.min_enlargement * max(shape) > max(mask.shape):
        return outline
    crop = crop_around(scene.photo, mask, margin, sam.SIDE)
    # --- MobileSAM's masks there; the one that is the same object ---
    corners = crop.within(np.array([[columns.start, rows.start], [columns.stop, rows.stop]]))
    left, top, right, bottom = np.round(corners).astype(int).ravel().tolist()
    logits, _ = sam.masks(crop.picture, box=(left, top, right, bottom))
    best = outline
    agreement = SETTINGS.min_agreement
    for look in logits:
        placed = crop.at_working_size(look, around)
        same = overlap(placed > 0, mask[around])
        sharpened = outline.copy()
        sharpened[around] += placed
        if same >= agreement and all(sharpened[y, x] > 0 for x, y in points):
            best = sharpened
            agreement = same
    return best


def _soft_overlap(likely: Array, mask: Array) -> float:
    """Intersection over union of likelihoods [H, W] in [0, 1] with a mask [H, W] bool."""
    return float(np.minimum(likely, mask).sum() / max(float(np.maximum(likely, mask).sum()), 1e-6))


def tidy(mask: Array, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] bool: the parts of a mask that hold a point (column, row), with holes below 2 % filled.

    Without points, or where no part holds one, all parts are kept that are not crumbs.
    """
    # Opening takes away lines of single pixels, unless one was clicked.
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc(1)) > 0
    opened = opened if all(opened[y, x] for x, y in points) else mask
    # A highlight or a thin shadow may cut an object in two: parts a little apart are one.
    wide = disc(max(2, round(SETTINGS.gap * max(mask.shape))))
    groups, count = ndimage.label(cv2.dilate(opened.astype(np.uint8), wide))
    if count == 0:
        return mask
    # Of several parts those that were clicked, else those of a tenth of the largest.
    parts = groups * opened
    sizes = np.bincount(parts.ravel())[1:]
    keep = {int(parts[y, x]) for x, y in points if parts[y, x]}
    keep = keep or set((np.flatnonzero(sizes >= 0.1 * sizes.max()) + 1).tolist())
    kept = np.isin(parts, list(keep))
    return remove_small_holes(kept, max_size=int(0.02 * kept.sum()))


def overlap(a: Array, b: Array) -> float:
    """Intersection over union of two masks [H, W]."""
    return float((a & b).sum() / max((a | b).sum(), 1))
