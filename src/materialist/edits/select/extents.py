"""From the object that a click selects to the next smaller or larger one there."""

from collections.abc import Callable

from materialist.edits.select.objects import EXTENTS
from materialist.types import Array

LARGER = 1.05
"""Least ratio of areas from which one region of a click is called larger than another (a definition)."""
SHARPENED = 1.2
"""Ratio by which sharpening hardly ever changes an area."""


def next_region(
    choose: Callable[..., Array],
    click: tuple[float, float],
    region: Array,
    *,
    larger: bool,
    others: Array | None = None,
) -> Array | None:
    """[H, W] bool: the next larger, or smaller, object at a click than a region [H, W] bool; None where there is none.

    choose: gives [H, W] bool of a `click` and an `extent`, sharpened or not, as `select` does. others: [H, W] bool that
    is selected besides; what it holds anyway is no change.
    """
    rough = [(choose(click=click, extent=one, sharpen=False).sum(), one) for one in EXTENTS[1:]]
    area = int(region.sum())
    for size, extent in sorted(rough, reverse=not larger):
        # Sharpening takes a second: only what may be the next one.
        ratio = size / area if larger else area / max(size, 1)
        if ratio * SHARPENED < LARGER:
            continue
        candidate = choose(click=click, extent=extent)
        differs = candidate != region if others is None else (candidate != region) & ~others
        ratio = candidate.sum() / area
        if differs.any() and (ratio if larger else 1 / ratio) >= LARGER:
            return candidate
    return None
