"""Regions drawn to the photo's edges by GrabCut (Rother et al. 2004)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from materialist.color import srgb_levels
from materialist.types import Array, Scene

POSSIBLE, PROBABLE, CERTAIN = 2, 3, 1
"""GrabCut's labels (cv2.GC_PR_BGD, cv2.GC_PR_FGD, cv2.GC_FGD); 0 is background."""


@dataclass(frozen=True)
class GrabCutSettings:
    """How far a border may move, in shares of the picture's longer side unless it says otherwise."""

    inwards: float = 0.02
    """How far the border may move inwards (tuned by eye)."""
    outwards: float = 0.22
    """How far it may move outwards: thin parts stick out (tuned by eye)."""
    unlikely: float = 0.3
    """Likelihood below which a pixel is none of the object; larger keeps the border closer (tuned by eye)."""
    near_likely: float = 0.015
    """Distance from likelier pixels up to which an unlikely one may still be of the object (tuned by eye)."""
    kept: float = 0.6
    """Overlap with the rough mask below which GrabCut has lost the object in its surroundings (tuned by eye)."""
    passes: int = 3
    """Times that the band follows the border: a first pass stops at a shadow (tuned by eye)."""
    gap: float = 0.015
    """Half of the gap across which two parts are one (tuned by eye)."""


DEFAULT = GrabCutSettings()


def refined(
    scene: Scene, rough: Array, points: Sequence[tuple[int, int]], likely: Array, settings: GrabCutSettings = DEFAULT
) -> Array:
    """[H, W] bool: the rough mask with its border moved to the photo's edges, a band at a time.

    `likely` [H, W] in [0, 1]: the border stays out of what is clearly none of the object. `points` (column, row) lie
    on the object.
    """
    import cv2

    disc = lambda share: _disc(share, rough)  # noqa: E731
    possible = cv2.dilate((likely > settings.unlikely).astype(np.uint8), disc(settings.near_likely)) > 0
    mask = rough
    for _ in range(settings.passes):
        inner = cv2.erode(mask.astype(np.uint8), disc(settings.inwards), borderValue=1) > 0
        if not inner.any():
            inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1) > 0
        outer = (cv2.dilate(mask.astype(np.uint8), disc(settings.outwards)) > 0) & (possible | mask)
        label = np.where(inner, CERTAIN, np.where(mask, PROBABLE, np.where(outer, POSSIBLE, 0))).astype(np.uint8)
        for x, y in points:
            label[y, x] = CERTAIN
        found = tidy(grabcut(scene, label), points)
        if overlap(found, mask) <= settings.kept:
            return tidy(mask, points)
        before, mask = mask, found
        if np.array_equal(before, mask):
            break
    return mask


def grabcut(scene: Scene, label: Array, rounds: int = 1) -> Array:
    """[H, W] bool from labels [H, W] uint8 (POSSIBLE, PROBABLE, CERTAIN or 0)."""
    import cv2

    ours = (label == CERTAIN) | (label == PROBABLE)
    if not ours.any() or (label != CERTAIN).sum() < 16:
        return ours
    picture = np.ascontiguousarray(srgb_levels(scene.photo.linear[..., ::-1]))
    labels = np.ascontiguousarray(label)
    cv2.setRNGSeed(0)
    try:
        model = np.zeros((1, 65)), np.zeros((1, 65))  # GrabCut's colour models, filled by it
        cv2.grabCut(picture, labels, (0, 0, 0, 0), *model, rounds, cv2.GC_INIT_WITH_MASK)
    except cv2.error:  # too few pixels on one side for its colour model
        return ours
    return (labels == CERTAIN) | (labels == PROBABLE)


def tidy(mask: Array, points: Sequence[tuple[int, int]], settings: GrabCutSettings = DEFAULT) -> Array:
    """[H, W] bool: the parts of a mask that hold a point (column, row), with holes below 2 % filled.

    Without points, or where no part holds one, all parts are kept that are not crumbs.
    """
    import cv2
    from scipy import ndimage

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    # A highlight or a thin shadow may cut an object in two: parts a little apart are one, with the gap.
    closed = cv2.morphologyEx(opened.astype(np.uint8), cv2.MORPH_CLOSE, _disc(settings.gap, mask)) > 0
    parts, count = ndimage.label(opened | closed)
    if count == 0:
        return mask
    sizes = np.bincount(parts.ravel())[1:]
    keep = {int(parts[y, x]) for x, y in points if parts[y, x]}
    keep = keep or set((np.flatnonzero(sizes >= 0.1 * sizes.max()) + 1).tolist())
    kept = np.isin(parts, list(keep))
    holes, count = ndimage.label(~kept)
    sizes = np.bincount(holes.ravel())[1:]
    return kept | np.isin(holes, np.flatnonzero(sizes < 0.02 * kept.sum()) + 1)


def overlap(a: Array, b: Array) -> float:
    """Intersection over union of two masks [H, W]."""
    return float((a & b).sum() / max((a | b).sum(), 1))


def _disc(share: float, mask: Array) -> Array:
    """A disc whose radius is a share of the picture's longer side."""
    import cv2

    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * max(2, round(share * max(mask.shape))) + 1,) * 2)
