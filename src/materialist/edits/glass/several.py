"""The parts of a mask: several objects, or one that something stands before."""

from __future__ import annotations

import numpy as np

from materialist.types import Array

SPECK = 0.01
"""A part smaller than this share of the largest is no object of its own."""
MANY = 6
"""More parts than this are one thing: leaves, a fence."""
BEFORE = 0.98
"""What is between two parts of one object is nearer than both, by this factor of their depth."""
NEAR = 4
"""Pixels around the ends of a gap whose depth is that of the parts."""


def objects_in(mask: Array, depth: Array) -> list[Array]:
    """[H, W] bool masks of the objects under a mask [H, W] bool, the largest first; together they are the mask.

    Parts are one object where what stands between them, at planar `depth` [H, W], is nearer than both.
    """
    import cv2

    count, label = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    if count <= 2:
        return [mask]
    area = np.bincount(label.ravel(), minlength=count)
    area[0] = 0
    large = [int(k) for k in np.argsort(-area) if area[k] >= max(SPECK * area.max(), 1)]
    if len(large) > MANY:
        return [mask]
    parts = [label == k for k in large]
    own = list(range(len(parts)))
    for i in range(len(parts)):
        for j in range(i):
            if own[i] != own[j] and _hidden_between(parts[i], parts[j], mask, depth):
                own = [own[j] if k == own[i] else k for k in own]
    found = [np.any([parts[k] for k in range(len(parts)) if own[k] == number], 0) for number in dict.fromkeys(own)]
    return _with_specks(found, mask)


def _hidden_between(a: Array, b: Array, mask: Array, depth: Array) -> bool:
    """Whether something nearer than both stands in the narrowest gap between two parts [H, W] bool."""
    from scipy.ndimage import distance_transform_edt

    away, place = distance_transform_edt(~b, return_indices=True)
    rows, columns = np.nonzero(a)
    k = int(away[rows, columns].argmin())
    first = np.array([rows[k], columns[k]])
    last = place[:, first[0], first[1]]
    steps = int(np.abs(last - first).max())
    line = np.round(np.linspace(first, last, steps + 1)).astype(int)
    gap = line[~mask[line[:, 0], line[:, 1]]]
    between = depth[gap[:, 0], gap[:, 1]]
    if not len(between) or not (between > 0).any():
        return False
    ends = min(_depth_near(part, depth, spot) for part, spot in ((a, first), (b, last)))
    return bool(np.median(between[between > 0]) < BEFORE * ends)


def _depth_near(part: Array, depth: Array, spot: Array) -> float:
    top, left = np.maximum(spot - NEAR, 0)
    window = np.s_[top : spot[0] + NEAR + 1, left : spot[1] + NEAR + 1]
    known = depth[window][part[window] & (depth[window] > 0)]
    return float(np.median(known)) if len(known) else 0.0


def _with_specks(parts: list[Array], mask: Array) -> list[Array]:
    """The parts, each with the pixels of the mask that are in none and next to it."""
    from scipy.ndimage import distance_transform_edt

    rest = mask & ~np.any(parts, 0)
    if not rest.any():
        return parts
    nearest = np.argmin([distance_transform_edt(~part) for part in parts], 0)
    return [part | (rest & (nearest == k)) for k, part in enumerate(parts)]
