"""Values carried smoothly into places where they are not known."""

import numpy as np
from scipy.ndimage import distance_transform_edt

from materialist.geometry.silhouette import window
from materialist.types import Array

_SWEEPS = 14
"""Relaxations at each size; the coarser sizes have done the rest (by eye)."""


def nearest(known: Array) -> tuple[Array, Array]:
    """[H, W] row and column of the nearest known place; known [H, W] bool, somewhere true."""
    rows, columns = distance_transform_edt(~known, return_distances=False, return_indices=True)
    return rows, columns


def membrane(values: Array, known: Array) -> Array:
    """Fill the unknown places of a map with a nearly harmonic surface: a membrane spanned by what is known around.

    values: [H, W] or [H, W, C]; what is not known [H, W] bool is not read. float32; the mean of nothing is 0.
    """
    known = np.asarray(known, bool)
    flat = np.where(known[..., None], np.asarray(values, np.float32).reshape(*known.shape, -1), 0)
    return _filled(flat, known).reshape(np.shape(values))


def _filled(values: Array, known: Array) -> Array:
    """[H, W, C] coarse to fine: half the size first, then relaxation."""
    height, width = known.shape
    if known.all() or not known.any():
        return values
    if min(height, width) < 2 or height * width <= 16:
        return np.where(known[..., None], values, values[known].mean(0))
    # Sums of four over what is known of them: means at half the size.
    padded = np.pad(known, ((0, height % 2), (0, width % 2)))
    weight = padded.astype(np.float32)[..., None]
    total = _halved(np.pad(values, ((0, height % 2), (0, width % 2), (0, 0))) * weight)
    count = _halved(weight)
    coarse = _filled(total / np.maximum(count, 1e-9), count[..., 0] > 0)
    fine = coarse.repeat(2, 0).repeat(2, 1)[:height, :width]
    return _relaxed(np.where(known[..., None], values, fine), known)


def _halved(values: Array) -> Array:
    """[H, W, C] -> [H/2, W/2, C], sums of four."""
    rows = values[::2] + values[1::2]
    return rows[:, ::2] + rows[:, 1::2]


def _relaxed(values: Array, known: Array) -> Array:
    """Each unknown place becomes the mean of its four neighbours, over and over; only around the unknown ones."""
    around = window(~known, margin=1)
    part = values[around].copy()
    free = ~known[around]
    for _ in range(_SWEEPS):
        framed = np.pad(part, ((1, 1), (1, 1), (0, 0)), mode="edge")
        mean = (framed[:-2, 1:-1] + framed[2:, 1:-1] + framed[1:-1, :-2] + framed[1:-1, 2:]) / 4
        part[free] = mean[free]
    out = values.copy()
    out[around] = part
    return out
