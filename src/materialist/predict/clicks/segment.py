"""From clicks on a photo to the object that they lie on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from materialist.errors import InputError, WeightsError
from materialist.predict.clicks.features import NORMAL_X, features
from materialist.types import Array

if TYPE_CHECKING:
    from materialist.predict.clicks.network import ClickNet

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""


@dataclass(frozen=True)
class ClickSettings:
    """How ClickNet looks at a photo: once at the whole, then closer at the object. Tuned by eye."""

    side: int = 224  # longer side at which the network sees the photo and the surroundings, pixels
    around: float = 1.8  # surroundings of the second look, in extents of the object
    closer: float = 0.8  # largest part of the photo that is worth a second look
    least: float = 0.3  # smallest part of the photo in a second look: the network learnt no finer detail


SETTINGS = ClickSettings()


class ClickMaps(NamedTuple):
    """What is known of each pixel."""

    rgb: Array
    """[H, W, 3] sRGB in [0, 1]."""
    normal: Array
    """[H, W, 3] unit."""
    depth: Array
    """[H, W] planar, 0 = no surface."""


def object_at(photo: ClickMaps, clicks: Sequence[tuple[int, int]], *, weights: str | Path = "") -> Array:
    """How likely each pixel belongs to the object that all clicks lie on.

    Args:
        clicks: (column, row), at least one, inside the photo.
        weights: a .safetensors file from `materialist train clicks`, or "" for those in the package.

    Returns:
        [H, W] float32 in [0, 1]; the same input gives the same result.

    Raises:
        InputError: no click, or one outside. WeightsError: weights that are missing, damaged, or of another network.
    """
    height, width = photo.depth.shape
    if not clicks or not all(0 <= x < width and 0 <= y < height for x, y in clicks):
        raise InputError(f"The clicks are {list(clicks)}; give at least one inside {width} x {height} pixels.")
    network = _loaded(Path(weights) if str(weights) else WEIGHTS)
    whole = _seen(network, photo, clicks, np.s_[0:height, 0:width])
    window = _around(whole > 0.5, clicks)
    if window is None:
        return whole
    closer = _seen(network, photo, clicks, window)
    found = np.zeros_like(whole)
    found[window] = closer[window]
    return found


def _around(mask: Array, clicks: Sequence[tuple[int, int]]) -> tuple[slice, slice] | None:
    """The window of the second look at what was found, [H, W] bool; None where the first showed it as well."""
    rows, columns = np.nonzero(mask)
    rows, columns = np.append(rows, [y for _, y in clicks]), np.append(columns, [x for x, _ in clicks])
    extent = max(np.ptp(rows), np.ptp(columns)) + 1
    side = max(SETTINGS.around * extent, SETTINGS.least * max(mask.shape))
    if side > SETTINGS.closer * max(mask.shape):
        return None
    found = []
    for places, size in ((rows, mask.shape[0]), (columns, mask.shape[1])):
        length = min(round(side), size)
        first = min(max(round((places.min() + places.max() - length) / 2), 0), size - length)
        found.append(slice(first, first + length))
    return found[0], found[1]


def _seen(network: ClickNet, photo: ClickMaps, clicks: Sequence[tuple[int, int]], window: tuple[slice, slice]) -> Array:
    """[H, W] float32 share in the window, 0 elsewhere: the mean of what the network says of it and its mirror image."""
    import cv2
    import torch

    from materialist.predict.network import STRIDE

    part = ClickMaps(*(np.ascontiguousarray(v[window], np.float32) for v in photo))
    height, width = part.depth.shape
    scale = SETTINGS.side / max(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    rgb, normal = (np.asarray(cv2.resize(v, size, interpolation=way)) for v in (part.rgb, part.normal))
    depth = np.asarray(cv2.resize(part.depth, size, interpolation=cv2.INTER_NEAREST))
    normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-6)
    top, left = window[0].start, window[1].start
    places = [
        (min(int((x - left + 0.5) * scale), size[0] - 1), min(int((y - top + 0.5) * scale), size[1] - 1))
        for x, y in clicks
        if 0 <= x - left < width and 0 <= y - top < height
    ]
    maps = features(rgb, normal, depth, places)
    below, beside = -maps.shape[1] % STRIDE, -maps.shape[2] % STRIDE
    padded = torch.from_numpy(np.pad(maps, ((0, 0), (0, below), (0, beside)), mode="edge"))[None]
    mirrored = padded.flip(-1)
    mirrored[:, NORMAL_X] *= -1
    with torch.inference_mode():
        both = (network(padded) + network(mirrored).flip(-1)) / 2
    share = both[0].sigmoid().numpy()[: maps.shape[1], : maps.shape[2]]
    found = np.zeros(photo.depth.shape, np.float32)
    found[window] = cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR)
    return found


@lru_cache(maxsize=2)
def _loaded(path: Path) -> Any:
    if not path.is_file():
        raise WeightsError(
            f"There are no weights of ClickNet at {path}; train some (materialist train clicks), or select with "
            "--with grabcut."
        )
    from materialist.predict.clicks.network import ClickNet

    return ClickNet.load(path)[0]
