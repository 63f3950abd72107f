"""Edges of maps put where the photo has them, and depth joined with the normals between them.

A small network knows that an object stands before a wall, but blurs its outline over many pixels; a mesh of that is a
tent. A median takes sides instead of mixing, and the photo's colours say with whom (Ma et al. 2013, "Constant Time
Weighted Median Filtering for Stereo Matching and Beyond"; He et al. 2013, "Guided Image Filtering").

Medians also print the photo's texture onto every slope, and a mesh with such steps shades itself in single pixels:
`with_relief` makes depth smooth along a surface, broken where it steps to another one.
"""

from typing import Any

import cv2
import numpy as np
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import cg

from materialist.color import srgb_levels
from materialist.types import Array

MAX_STEP = 0.015
"""Change of log depth from pixel to pixel, beyond what the normals demand, above which two surfaces meet; by eye."""
STEP_WEIGHT = 1e-3
"""Weight of a pair of pixels across such a step; larger joins the two surfaces."""
MIN_COSINE = 0.12
"""Least n.v of a normal that depth follows."""
RELIEF_PIXELS = 10.0
"""Pixels above which the depth decides, below which the normals do; tuned by eye."""

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


def weighted_median(values: Array, guide: GuidedFilter, known: Array, *, bins: int = 32) -> Array:
    """[H, W] float32: at every pixel the median of the values around it, weighted by `guide`.

    Values between their 0.5 and 99.5 percentiles are told apart by `bins` steps and by linear interpolation within.
    Those of pixels that are not known [H, W] bool do not count, and stay.
    """
    low, high = np.percentile(values[known], [0.5, 99.5]) if known.any() else (0.0, 0.0)
    if not high > low:
        return values.astype(np.float32)
    # --- A histogram at every pixel: each value counts for its two neighbouring bins ---
    place = np.where(
        known, np.clip((values - low) / (high - low) * (bins - 1), 0, bins - 1), -1
    ).astype(np.float32)
    shares = np.stack(
        [np.maximum(guide.share(np.maximum(1 - np.abs(place - k), 0)), 0) for k in range(bins)]
    )
    # --- The bin in which half of the weight is reached ---
    total = np.cumsum(shares, axis=0)  # [bins, H, W]
    half = total[-1] / 2
    index = np.argmax(total >= half, axis=0)
    weight_before = np.take_along_axis(total, index[None], 0)[0]
    bin_weight = np.take_along_axis(shares, index[None], 0)[0]
    # Within a step the weight is spread evenly over it, from half a step before to half a step after.
    position = index + 0.5 - (weight_before - half) / np.maximum(bin_weight, 1e-9)
    median = low + np.clip(position, 0, bins - 1) / (bins - 1) * (high - low)
    return np.where(known & (half > 0), median, values).astype(np.float32)


def with_relief(sharp: Array, normal: Array, rays: Array) -> Array:
    """[H, W] float32 log depth that follows the normals in the small, and `sharp` in the large and at its steps.

    Solves min over u of sum of w |u_q - u_p - g_pq|^2 over neighbours + sum |u_p - sharp_p|^2 / RELIEF_PIXELS^2,
    where g is the slope that the normals demand (`demanded_slopes`).

    sharp: [H, W] logarithm of depth with edges, NaN where there is no surface; so is the result. normal: [H, W, 3]
    unit. rays: [H, W, 2] x and y of the rays at z = -1.
    """
    known = np.isfinite(sharp)
    if known.sum() < 9:
        return sharp
    # --- Unknowns: one a known pixel; equations: one a pair of neighbours ---
    index = np.cumsum(known.ravel()).reshape(known.shape) - 1
    pairs = []
    neighbours: list[tuple[Any, Any]] = [
        (np.s_[:, :-1], np.s_[:, 1:]),
        (np.s_[:-1], np.s_[1:]),
    ]  # in rows, in columns
    for demanded, (near, far) in zip(demanded_slopes(normal, rays), neighbours, strict=True):
        both = known[near] & known[far]
        change = (sharp[far] - sharp[near])[both].astype(np.float64)
        slope = ((demanded[near] + demanded[far]) / 2)[both].astype(np.float64)
        # Where depth jumps by more than the slope explains, two surfaces meet: the pair hardly
        # counts.
        weight = np.where(np.abs(change) > MAX_STEP + np.abs(slope), STEP_WEIGHT, 1.0)
        pairs.append((index[near][both], index[far][both], slope - change, weight))
    first, second, target, weight = (np.concatenate(column) for column in zip(*pairs, strict=True))

    # --- Solved for the change from `sharp`, which starts near 0 ---
    pull = np.full(int(known.sum()), RELIEF_PIXELS**-2)
    log_depth = np.array(sharp, np.float32)
    log_depth[known] += least_squares_change(
        first, second, target, weight, pull, rtol=1e-3, maxiter=100
    )
    return log_depth


def demanded_slopes(normal: Array, rays: Array) -> tuple[Array, Array]:
    """[H, W] change of log depth from one pixel to the next that the normals demand, to the right and downwards.

    n . d(z r) = 0 along the surface gives d log z = -n . dr / (n . r). normal: [H, W, 3] unit, camera frame.
    rays: [H, W, 2 or 3] through the pixels at z = -1, evenly spaced.
    """
    x = rays[..., 0]
    y = rays[..., 1]
    across = float(x[0, -1] - x[0, 0]) / max(x.shape[1] - 1, 1)
    down = float(y[-1, 0] - y[0, 0]) / max(y.shape[0] - 1, 1)
    facing = normal[..., 0] * x + normal[..., 1] * y - normal[..., 2]
    # n . r < 0 where the surface is seen; grazing normals would make the slope run to infinity.
    facing = np.minimum(facing, -MIN_COSINE * np.sqrt(x**2 + y**2 + 1))
    return -normal[..., 0] * across / facing, -normal[..., 1] * down / facing


def least_squares_change(
    first: Array,
    second: Array,
    target: Array,
    weight: Array,
    pull: Array,
    *,
    rtol: float,
    maxiter: int,
) -> Array:
    """[N] float64, min over u of sum of weight |u_second - u_first - target|^2 + sum of pull |u|^2.

    Conjugate gradients, preconditioned by the diagonal, as far as `rtol` and `maxiter` say. first, second: [P] which
    of the N unknowns a pair joins. target, weight: [P]. pull: [N] above 0.
    """
    # The matrix of differences, rows scaled by the root of their weight; then the normal
    # equations.
    rows = np.tile(np.arange(len(first)), 2)
    root = np.sqrt(weight)
    entries = (np.concatenate([-root, root]), (rows, np.concatenate([first, second])))
    step = coo_matrix(entries, (len(first), len(pull))).tocsr()
    system = (step.T @ step + diags(pull)).tocsr()
    change, _ = cg(
        system, step.T @ (root * target), rtol=rtol, maxiter=maxiter, M=diags(1 / system.diagonal())
    )
    return change
