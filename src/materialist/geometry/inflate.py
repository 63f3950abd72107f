"""How thick objects are, when only their outline is known: as if every section across were round."""

from __future__ import annotations

import numpy as np

from materialist.geometry.objects import Objects
from materialist.types import Array

LEVELS = 12
"""Widths that are told apart, from the widest part of an object down by a fixed ratio."""


def inflated(objects: Objects, depth: Array, spacing: float) -> Array:
    """[H, W] float64 length of the camera ray in each object, scene units; 0 elsewhere.

    depth: [H, W] planar scene units. spacing: distance of neighbouring rays at z = -1 (one over the focal length).

    With the distance w to the free outline and the radius r of the widest disc in the object that holds the pixel, the
    ray through a round section is 2 sqrt(w (2 r - w)) long: exact for balls and upright cylinders seen from afar. What
    hides the object, touches it or cuts it is no outline of its own, and does not make it thinner.
    """
    out = np.zeros(objects.label.shape)
    free = objects.pixel[objects.free]
    for k in range(int(objects.label.max(initial=-1)) + 1):
        inside = objects.label == k
        rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
        box = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        rim = np.zeros(inside.shape, bool)
        rim.ravel()[free[objects.label.ravel()[free] == k]] = True
        out[box][inside[box]] = _round(inside[box], rim[box])[inside[box]]
    # A pixel is as wide as at the middle of the ray, where the outline is, not at the front.
    share = np.minimum(out * spacing, 1)
    return share * np.asarray(depth, np.float64) / (1 - share / 2)


def _round(inside: Array, rim: Array) -> Array:
    """[h, w] thickness in pixels of an object [h, w] whose free outline passes by the pixels `rim` [h, w]."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    width = np.where(inside, distance_transform_edt(~rim) + 0.5, 0)  # [h, w] to the outline
    widest = float(width.max())
    radius = width.copy()
    for level in np.geomspace(0.5, 0.999 * widest, LEVELS):
        core = width >= level
        within = distance_transform_edt(~core) < level
        radius = np.where(within & inside, np.maximum(radius, level), radius)
    weight = gaussian_filter(inside.astype(float), 0.1 * widest)
    radius = np.maximum(gaussian_filter(np.where(inside, radius, 0), 0.1 * widest) / np.maximum(weight, 1e-9), width)
    return 2 * np.sqrt(np.maximum(width * (2 * radius - width), 0))
