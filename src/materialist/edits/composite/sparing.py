"""Path tracing of an edit that spends its paths where the edit is still noisy.

Both pictures are begun with a quarter of the camera rays of every pixel. What the two halves disagree on in the
difference says where the others are needed: on the edited surface always, elsewhere where the noise could be seen.
A pixel's own luck hardly counts for that, since noise is measured over its neighbourhood: the mean stays what it was
but for the weight of one pixel in WINDOW**2. Rays of the two rounds are those of one full picture, so where all are
traced the result is as stratified as without this.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from materialist.render.share import Share
from materialist.types import Array

Begun = Callable[[int, int, Share], tuple[Array, int]]
"""render(spp, seed, share) -> [H, W, 3] float32 linear, the mean of a share of the rays (0 where there are none), and
how many rays a pixel those are."""
EVERY = 4
"""One ray in so many belongs to the first round."""
FEWEST = 96
"""Paths a pixel from which a first round tells enough."""
WINDOW = 9
"""Pixels across, over which noise is measured."""
LEVELS = 1.5
"""Noise of the difference, in levels of an 8-bit sRGB picture, that may stay; denoising and shrinkage come after."""


def spared(
    pair: tuple[Begun, Begun], changed: Array, *, spp: int, seed: int, tick: Callable[[str, int, int], None]
) -> tuple[list[list[Array]], Array]:
    """([[base, edited], [base, edited]] in two independent halves, [H, W, 3] each; [H, W] bool: where all was traced).

    Args:
        pair: the base and the edited picture.
        changed: [H, W] bool: pixels that get all their paths.
        spp: paths a pixel of both halves together.
    """
    each, order = -(-spp // 2), ((0, 0), (0, 1), (1, 0), (1, 1))
    halves: list[list[Array]] = [[], []]
    first = rest = 0
    for done, (k, j) in enumerate(order):
        tick("render", done, 8)
        picture, first = pair[j](each, 2 * seed + k, Share(EVERY))
        halves[k].append(picture)
    (b0, e0), (b1, e1) = halves
    if all(np.array_equal(b, e) for b, e in halves):
        return halves, np.zeros(changed.shape, bool)
    needed = changed | noisy(e0 - b0, e1 - b1, (b0 + b1) / 2)
    others = Share(EVERY, rest=True, pixels=np.flatnonzero(needed))
    for done, (k, j) in enumerate(order, 4):
        tick("render", done, 8)
        more, rest = pair[j](each, 2 * seed + k, others)
        both = (first * halves[k][j] + rest * more) / np.float32(first + rest)
        halves[k][j] = np.where(needed[..., None], both, halves[k][j])
    return halves, needed


def noisy(d0: Array, d1: Array, tone: Array) -> Array:
    """[H, W] bool: where the noise of a difference would be seen.

    d0, d1: [H, W, 3] linear, the difference in two independent halves; their mean has the noise |d0 - d1| / 2, as the
    root of the mean square nearby. tone: [H, W, 3] linear, what the difference is laid on: a step is seen best in the
    dark.
    """
    import cv2

    box = lambda v: cv2.blur(np.ascontiguousarray(v, np.float64), (WINDOW, WINDOW), borderType=cv2.BORDER_REFLECT)  # noqa: E731
    noise = np.sqrt(np.maximum(box(((d0 - d1) / 2) ** 2), 0))  # a running sum may end below 0
    slope = 1.055 / 2.4 * np.maximum(box(tone), 0.0031308) ** (1 / 2.4 - 1)  # of the sRGB curve
    return (255 * slope * noise).max(-1) > LEVELS
