"""A rough region drawn to the photo's edges by GrabCut (Rother et al. 2004)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from materialist.color import srgb_levels
from materialist.edits.select.objects import certainty
from materialist.types import Array, Scene

_INNER, _OUTER = 0.02, 0.22
"""How far the border may move inwards and outwards, as a share of the longer side; thin parts stick out."""

_UNLIKELY, _BESIDE = 0.04, 0.015
"""Likelihood below which, and this far (a share of the longer side) from where it is more, nothing is of the object."""
_SURE, _UNLIKELY_THEN = 0.7, 0.3
"""Certainty of the likelihoods from which a larger one is asked for."""
_PASSES = 3
"""How often the band follows the border: a first pass stops at a shadow, whose far side the next one can reach."""
_SETTLED = 0.98
"""Overlap of two passes from which a third would change nothing."""

_GAP = 0.015
"""Half of the gap across which two parts are one, as a share of the longer side."""


def refined(scene: Scene, rough: Array, points: Sequence[tuple[int, int]], likely: Array | None = None) -> Array:
    """[H, W] bool: the rough mask with its border moved to where colour and depth change, a band at a time.

    Where `likely` [H, W] in [0, 1] is given, the border stays out of what is clearly none of the object.
    """
    mask = _moved(scene, rough, points, likely)
    for _ in range(_PASSES - 1):
        wider = _moved(scene, mask, points, likely)
        settled = overlap(wider, mask) > _SETTLED
        mask = wider
        if settled:
            break
    return mask


def _moved(scene: Scene, rough: Array, points: Sequence[tuple[int, int]], likely: Array | None) -> Array:
    """[H, W] bool: the rough mask with its border moved within a band."""
    import cv2

    mask = rough.astype(np.uint8)
    inner, outer = cv2.erode(mask, _disc(_INNER, rough), borderValue=1) > 0, cv2.dilate(mask, _disc(_OUTER, rough)) > 0
    if not inner.any():
        inner = cv2.erode(mask, np.ones((3, 3), np.uint8), borderValue=1) > 0
    if likely is not None:
        least = _UNLIKELY_THEN if certainty(likely) >= _SURE else _UNLIKELY
        possible = cv2.dilate((likely > least).astype(np.uint8), _disc(_BESIDE, rough)) > 0
        outer &= possible | rough
    label = np.where(inner, cv2.GC_FGD, np.where(rough, cv2.GC_PR_FGD, np.where(outer, cv2.GC_PR_BGD, cv2.GC_BGD)))
    for x, y in points:
        label[y, x] = cv2.GC_FGD
    found = tidy(grabcut(scene, label.astype(np.uint8)), points)
    # GrabCut can lose an object whose colours are those of its surroundings; the rough mask is then better.
    return found if overlap(found, rough) > 0.6 else tidy(rough, points)


def overlap(a: Array, b: Array) -> float:
    """Intersection over union of two masks [H, W]."""
    return float((a & b).sum() / max((a | b).sum(), 1))


def _disc(share: float, mask: Array) -> Array:
    """A disc whose radius is a share of the picture's longer side."""
    import cv2

    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * max(2, round(share * max(mask.shape))) + 1,) * 2)


def grabcut(scene: Scene, label: Array, rounds: int = 1) -> Array:
    """[H, W] bool from labels [H, W] uint8 (cv2.GC_*)."""
    import cv2

    if not ((label == cv2.GC_FGD) | (label == cv2.GC_PR_FGD)).any() or (label != cv2.GC_FGD).sum() < 16:
        return label == cv2.GC_FGD
    picture = srgb_levels(scene.photo.linear[..., ::-1])
    labels = np.ascontiguousarray(label)
    cv2.setRNGSeed(0)
    try:
        model = np.zeros((1, 65)), np.zeros((1, 65))  # GrabCut's colour models, filled by it
        cv2.grabCut(np.ascontiguousarray(picture), labels, (0, 0, 0, 0), *model, rounds, cv2.GC_INIT_WITH_MASK)
    except cv2.error:  # too few pixels on one side for its colour model
        return (label == cv2.GC_FGD) | (label == cv2.GC_PR_FGD)
    return (labels == cv2.GC_FGD) | (labels == cv2.GC_PR_FGD)


def tidy(mask: Array, points: Sequence[tuple[int, int]] | None) -> Array:
    """[H, W] bool: the parts of a mask that hold a point (column, row), with holes below 2 % filled.

    Without points all parts are kept that are not crumbs.
    """
    import cv2
    from scipy import ndimage

    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (3, 3))
    opened = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_OPEN, kernel) > 0
    # A highlight or a thin shadow may cut an object in two: parts a little apart are one, and the gap is theirs.
    joined = opened | (cv2.morphologyEx(opened.astype(np.uint8), cv2.MORPH_CLOSE, _disc(_GAP, mask)) > 0)
    parts, count = ndimage.label(joined)
    if count == 0:
        return mask
    sizes = np.bincount(parts.ravel())[1:]
    keep = {int(parts[y, x]) for x, y in points or () if parts[y, x]}
    keep = keep or set((np.flatnonzero(sizes >= 0.1 * sizes.max()) + 1).tolist())
    kept = np.isin(parts, list(keep))
    holes, count = ndimage.label(~kept)
    sizes = np.bincount(holes.ravel())[1:]
    return kept | np.isin(holes, np.flatnonzero(sizes < 0.02 * kept.sum()) + 1)
