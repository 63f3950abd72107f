"""The object at clicks or in a box: by ClickNet, or by GrabCut (Rother et al. 2004)."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage
from skimage.morphology import remove_small_holes
from skimage.segmentation import random_walker

from materialist.color import linear_to_srgb
from materialist.geometry.silhouette import disc, window
from materialist.predict.bundled.edges import GuidedFilter, grabcut
from materialist.predict.clicks import segment
from materialist.predict.clicks.features import Box
from materialist.types import Array, Scene


@dataclass(frozen=True)
class SelectSettings:
    """Where ClickNet and GrabCut look; lengths in longer sides; tuned by eye unless said otherwise."""

    min_box_overlap: float = 0.25  # of the object's box with the given one; less: misplaced
    gap: float = 0.015  # half of the gap across which two parts are one

    # GrabCut: radii around a click; tuned on 54 clicks.
    core_radius: float = 0.01  # certainly of the object
    probable_radius: float = 0.08  # taken for the object at first
    max_radius: float = 0.24  # beyond, GrabCut does not look

    # ClickNet: unsure pixels are shared out by a random walk; tuned on 74 clicks in 12 photos.
    min_sure: float = 0.9  # likelihood of a pixel of the object; below 1 - min_sure it is not
    walk_side: int = 256  # longer side at which they are shared out, pixels
    walk_edge_weight: float = 2000.0  # of the photo's edges; larger keeps to them more

    # The outline moves to edges of the photo; tuned on 206 clicks.
    outline_reach: float = 0.02  # how far
    colour_noise: float = 0.01  # standard deviation of colour that is no edge, sRGB-encoded


SETTINGS = SelectSettings()


def object_at_points(
    scene: Scene, points: Sequence[tuple[int, int]], *, network: bool = True
) -> Array:
    """[H, W] bool of the object that all (column, row) points lie on."""
    if network:
        photo = linear_to_srgb(scene.photo.linear)
        likely = segment.object_likelihood(photo, scene.normal, scene.depth, points)
        return outlined(photo, _divided(photo, likely), points)
    return tidy(grabcut(scene.photo.linear, _around(scene, points)), points)


def object_in(scene: Scene, box: Box, *, network: bool = True) -> Array:
    """[H, W] bool of the object in a box; empty where what is found does not fill it.

    GrabCut takes for the object what is not seen outside of the box: a tight box suits it.
    """
    inside = np.zeros(scene.depth.shape, np.uint8)
    inside[box[1] : box[3], box[0] : box[2]] = 1
    if network:
        photo = linear_to_srgb(scene.photo.linear)
        mask = outlined(
            photo, segment.object_likelihood(photo, scene.normal, scene.depth, box=box) * inside, ()
        )
    else:
        mask = tidy(grabcut(scene.photo.linear, inside * np.uint8(cv2.GC_PR_FGD)), ())
    return mask if box_overlap(mask, box) >= SETTINGS.min_box_overlap else np.zeros_like(mask)


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


def outlined(photo: Array, likely: Array, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] bool of the object at points (column, row), from likelihoods [H, W] in [0, 1]; photo [H, W, 3] sRGB.

    The outline moves to edges of the photo near it (guided filter, He et al. 2013).
    """
    radius = max(2, round(SETTINGS.outline_reach * max(likely.shape)))
    guide = GuidedFilter(photo, radius=radius, eps=SETTINGS.colour_noise**2)
    return tidy(guide.share(likely) > 0.5, points)


def _divided(photo: Array, likely: Array) -> Array:
    """[H, W] float32 in [0, 1]: likelihoods with unsure pixels given to what they lie with in the photo [H, W, 3] sRGB.

    A random walk (Grady 2006) at a small size. A click leaves much unsure; what a box finds is worse with it.
    """
    height, width = likely.shape
    scale = min(1.0, SETTINGS.walk_side / max(height, width))
    size = max(1, round(width * scale)), max(1, round(height * scale))

    def shrunk(picture: Array) -> Array:
        small = cv2.resize(picture.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return np.asarray(small)

    small = shrunk(likely)
    seen = shrunk(photo)
    # --- Seeds: 1 surely the object, 2 surely not, 0 unsure ---
    seeds = np.where(small > SETTINGS.min_sure, 1, np.where(small < 1 - SETTINGS.min_sure, 2, 0))
    if len(np.unique(seeds)) < 3:  # one side has none, or nothing is unsure
        return likely.astype(np.float32)
    with warnings.catch_warnings(action="ignore"):  # that other solvers are faster
        # The chance that a walk from each pixel reaches the object's seeds first.
        share = random_walker(
            seen,
            seeds,
            beta=SETTINGS.walk_edge_weight,
            mode="cg_j",
            channel_axis=-1,
            return_full_prob=True,
        )[0]
    return np.asarray(
        cv2.resize(share.astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    )


def tidy(mask: Array, points: Sequence[tuple[int, int]]) -> Array:
    """[H, W] bool: the parts of a mask that hold a point (column, row), with holes below 2 % filled.

    Without points, or where no part holds one, all parts are kept that are not crumbs.
    """
    # Opening takes away lines of single pixels.
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, disc(1)) > 0
    # A highlight or a thin shadow may cut an object in two: parts a little apart are one, with the gap.
    wide = disc(max(2, round(SETTINGS.gap * max(mask.shape))))
    closed = cv2.morphologyEx(opened.astype(np.uint8), cv2.MORPH_CLOSE, wide) > 0
    parts, count = ndimage.label(opened | closed)
    if count == 0:
        return mask
    sizes = np.bincount(parts.ravel())[1:]
    keep = {int(parts[y, x]) for x, y in points if parts[y, x]}
    keep = keep or set((np.flatnonzero(sizes >= 0.1 * sizes.max()) + 1).tolist())
    kept = np.isin(parts, list(keep))
    return remove_small_holes(kept, max_size=int(0.02 * kept.sum()))


def overlap(a: Array, b: Array) -> float:
    """Intersection over union of two masks [H, W]."""
    return float((a & b).sum() / max((a | b).sum(), 1))
