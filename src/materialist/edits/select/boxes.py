"""The object that somebody has drawn a box around."""

from __future__ import annotations

import numpy as np

from materialist.edits.select.objects import certainty, likely
from materialist.edits.select.refine import grabcut, overlap, tidy
from materialist.types import Array, Scene

Box = tuple[int, int, int, int]
"""(x0, y0, x1, y1), the latter two beyond it."""
SEEDS = ((0.5, 0.5), (0.3, 0.3), (0.7, 0.3), (0.3, 0.7), (0.7, 0.7))
"""Places in a box, shares of its sides, at which ClickNet is asked what lies there."""
WITHIN = 0.8
"""Part of what ClickNet finds at a place that must lie in the box: a table's does not."""
VAIN = 3
"""So many places where nothing of the kind lies are enough."""
SLACK = 0.05
"""How far outside of a box drawn too small the object may reach, as a share of the box's shorter side."""
SURE, LIKELY = 0.75, 0.4
"""Certainty from which ClickNet is believed, and likelihood from which a pixel may well be of the object."""
FITS, AGREES = 0.95, 0.8
"""Overlap of a result's own box with the given one, and with what ClickNet finds, from which it needs no such help."""
LOST = 0.5
"""Overlap with what ClickNet finds below which GrabCut has lost an object with the colours of its surroundings."""
FILLS, GROWTH = 0.8, (0.04, 0.08, 0.16)
"""Overlap of boxes below which a larger one is tried, and how much larger, in units of the shorter side."""
POSSIBLE, PROBABLE = 2, 3
"""GrabCut's labels (cv2.GC_PR_BGD, cv2.GC_PR_FGD)."""


def in_box(scene: Scene, box: Box, *, network: bool = True) -> Array:
    """[H, W] bool of the object in a box, by GrabCut; with `network` by ClickNet, too, where that is sure.

    GrabCut alone takes what is not seen outside of the box for the object: a tight box suits it, a loose one leaves
    the table around the object in, and of one that cuts the object nothing may be left.
    """
    plain = _fitting(scene, box)
    likely = _likely(scene, box) if network else None
    if likely is None or certainty(likely) < SURE:
        return plain
    label = _label(scene, grown(box, SLACK, scene.depth.shape), POSSIBLE)
    label[(likely > LIKELY) & (label == POSSIBLE)] = PROBABLE
    rough, told = tidy(likely > 0.5, None), tidy(grabcut(scene, label, rounds=5), None)
    if overlap(told, rough) < LOST:
        told = rough
    return plain if overlap_of_boxes(plain, box) >= FITS and overlap(plain, told) >= AGREES else told


def grown(box: Box, share: float, shape: tuple[int, ...]) -> Box:
    """A box larger on every side by a share of its shorter side, at least a pixel, within a picture of [H, W]."""
    x0, y0, x1, y1 = box
    more = max(1, round(share * min(x1 - x0, y1 - y0)))
    return max(x0 - more, 0), max(y0 - more, 0), min(x1 + more, shape[1]), min(y1 + more, shape[0])


def overlap_of_boxes(mask: Array, box: Box) -> float:
    """Intersection over union of the bounding box of a mask [H, W] bool with a box; 0 for an empty mask."""
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    if not rows.size:
        return 0.0
    own = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    width, height = (min(own[k + 2], box[k + 2]) - max(own[k], box[k]) for k in (0, 1))
    both = max(width, 0) * max(height, 0)
    area = lambda b: (b[2] - b[0]) * (b[3] - b[1])  # noqa: E731
    return float(both / (area(own) + area(box) - both))


def _label(scene: Scene, box: Box, value: int) -> Array:
    x0, y0, x1, y1 = box
    label = np.zeros(scene.depth.shape, np.uint8)
    label[y0:y1, x0:x1] = value
    return label


def _fitting(scene: Scene, box: Box) -> Array:
    """[H, W] bool by GrabCut in the box, or in the larger one whose result fills the given one best."""
    best, most = np.zeros(scene.depth.shape, bool), -1.0
    for tried in (box, *(grown(box, share, scene.depth.shape) for share in GROWTH)):
        found = tidy(grabcut(scene, _label(scene, tried, PROBABLE), rounds=5), None)
        fit = overlap_of_boxes(found, box)
        if fit > most:
            best, most = found, fit
        if most >= FILLS:
            break
    return best


def _likely(scene: Scene, box: Box) -> Array | None:
    """[H, W] in [0, 1], 0 outside of the box: how likely a pixel is of something in it, says ClickNet.

    None where it finds nothing that ends in the box.
    """

    x0, y0, x1, y1 = grown(box, SLACK, scene.depth.shape)
    inside = np.zeros(scene.depth.shape, bool)
    inside[y0:y1, x0:x1] = True
    found, vain = np.zeros(scene.depth.shape, np.float32), 0
    for across, down in SEEDS:
        x, y = (int(a + share * (b - a)) for a, b, share in zip(box[:2], box[2:], (across, down)))
        if scene.depth[y, x] > 0 and found[y, x] <= 0.5:  # else it is sky, or of what was found already
            share = likely(scene, [(x, y)])
            if (share * inside).sum() > WITHIN * share.sum():
                found = np.maximum(found, share * inside)
            else:
                vain += 1
        if vain == VAIN:
            break
    return found if found.any() else None
