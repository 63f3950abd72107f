"""Edges of maps put where the photo has them.

A small network knows that an object stands before a wall, but blurs its outline over many pixels; a mesh of that is a
tent. A median takes sides instead of mixing, and the photo's colours say with whom (Ma et al. 2013, "Constant Time
Weighted Median Filtering for Stereo Matching and Beyond"; He et al. 2013, "Guided Image Filtering").

Medians also print the photo's texture onto every slope; `geometry.integrate` takes it out of the depth again.
"""

import cv2
import numpy as np

from materialist.color import srgb_levels
from materialist.types import Array

MIN_COLOUR_PIXELS = 5
"""Pixels that a colour model of GrabCut needs: one for each of its parts; derived: OpenCV's."""


def grabcut(photo: Array, labels: Array) -> Array:
    """[H, W] bool: the foreground by the photo's colours (GrabCut, Rother et al. 2004).

    photo: [H, W, 3] linear. labels: [H, W] uint8, cv2.GC_FGD and so on: what is certain, and what is likely at first;
    the result is their foreground where one side has too few pixels for a colour model.
    """
    likely = np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))
    if min(likely.sum(), (~likely).sum()) < MIN_COLOUR_PIXELS:
        return likely
    # GrabCut fills both in place; a fixed seed makes its clustering repeatable.
    labels = labels.copy()
    models = (np.zeros((1, 65)), np.zeros((1, 65)))
    cv2.setRNGSeed(0)
    cv2.grabCut(srgb_levels(photo), labels, (0, 0, 0, 0), *models, 5, cv2.GC_INIT_WITH_MASK)
    return np.isin(labels, (cv2.GC_FGD, cv2.GC_PR_FGD))


class GuidedFilter:
    """A photo [H, W, 3] sRGB as a guide: W_ij = mean over windows k of 1 + (I_i - m_k)^T (S_k + eps)^-1 (I_j - m_k).

    m_k and S_k are mean and covariance of colours in the window, so that pixels on one side of an edge count for each
    other, and those across it do not. radius: of the windows, pixels. eps: variance of colour that is not yet an edge.
    """

    def __init__(self, photo: Array, *, radius: int, eps: float = 1e-3):
        self.window = (2 * radius + 1,) * 2
        self.planes = [np.ascontiguousarray(c, np.float32) for c in np.moveaxis(photo, -1, 0)]
        self.mean = [self._box(c) for c in self.planes]
        # --- S_k: the covariance of colours in every window, symmetric ---
        covariance = np.empty((*photo.shape[:2], 3, 3), np.float64)
        for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)):
            entry = self._box(self.planes[i] * self.planes[j]) - self.mean[i] * self.mean[j]
            covariance[..., i, j] = covariance[..., j, i] = entry
        # --- (S_k + eps)^-1, as nine planes, so that each product is one pass over the picture ---
        inverse = np.linalg.inv(covariance + eps * np.eye(3))
        self.inverse = [
            [np.ascontiguousarray(inverse[..., i, j], np.float32) for j in range(3)]
            for i in range(3)
        ]

    def share(self, members: Array) -> Array:
        """[H, W] weighted share of `members` [H, W] float32 in [0, 1] around each pixel: sum_j W_ij members_j."""
        # A linear function of colour for each window: slopes and offset (He et al. 2013,
        # eqs. 5 and 6).
        level = self._box(members)
        with_colour = [
            self._box(c * members) - m * level for c, m in zip(self.planes, self.mean, strict=True)
        ]
        demanded_slopes = [
            sum(r * c for r, c in zip(row, with_colour, strict=True)) for row in self.inverse
        ]
        offset = level - sum(s * m for s, m in zip(demanded_slopes, self.mean, strict=True))
        # --- Each pixel gets the mean of the functions of all windows that it lies in ---
        return self._box(offset) + sum(
            self._box(s) * c for s, c in zip(demanded_slopes, self.planes, strict=True)
        )

    def _box(self, plane: Array) -> Array:
        """[H, W] means of a plane over the windows."""
        return cv2.blur(plane, self.window, borderType=cv2.BORDER_REFLECT)


BINS = 32
"""Steps between which a weighted median tells values apart."""


def weighted_median(values: Array, guide: GuidedFilter, known: Array) -> Array:
    """[H, W] float32: at every pixel the median of the values around it, weighted by `guide`.

    Values between their 0.5 and 99.5 percentiles are told apart by BINS steps and by linear interpolation within.
    Those of pixels that are not known [H, W] bool do not count, and stay.
    """
    low, high = np.percentile(values[known], [0.5, 99.5]) if known.any() else (0.0, 0.0)
    if not high > low:
        return values.astype(np.float32)
    # --- A histogram at every pixel: each value counts for its two neighbouring bins ---
    place = np.where(
        known, np.clip((values - low) / (high - low) * (BINS - 1), 0, BINS - 1), -1
    ).astype(np.float32)
    shares = np.stack(
        [np.maximum(guide.share(np.maximum(1 - np.abs(place - k), 0)), 0) for k in range(BINS)]
    )
    # --- The bin in which half of the weight is reached ---
    total = np.cumsum(shares, axis=0)  # [BINS, H, W]
    half = total[-1] / 2
    index = np.argmax(total >= half, axis=0)
    weight_before = np.take_along_axis(total, index[None], 0)[0]
    bin_weight = np.take_along_axis(shares, index[None], 0)[0]
    # Within a step the weight is spread evenly over it, from half a step before to half a step after.
    position = index + 0.5 - (weight_before - half) / np.maximum(bin_weight, 1e-9)
    median = low + np.clip(position, 0, BINS - 1) / (BINS - 1) * (high - low)
    return np.where(known & (half > 0), median, values).astype(np.float32)
