"""From clicks on a photo to the object that they lie on."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from materialist.camera import unit
from materialist.errors import InputError
from materialist.predict.clicks.features import NORMAL_X, features
from materialist.types import Array

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""
SIDE = 224
"""Longer side at which the network sees the photo, pixels."""


class ClickMaps(NamedTuple):
    """What is known of each pixel."""

    rgb: Array
    """[H, W, 3] sRGB in [0, 1]."""
    normal: Array
    """[H, W, 3] unit."""
    depth: Array
    """[H, W] planar, 0 = no surface."""


def object_at(photo: ClickMaps, clicks: Sequence[tuple[int, int]], *, weights: str | Path = "") -> Array:
    """[H, W] float32 in [0, 1]: how likely each pixel belongs to the object that all clicks lie on.

    The mean over the photo and its mirror image. `clicks`: (column, row), at least one. `weights`: a file of
    `materialist train clicks`, or "" for those in the package. Raises InputError for no click or one outside,
    WeightsError.
    """
    import cv2
    import torch

    from materialist.predict.clicks.network import ClickNet
    from materialist.predict.network import STRIDE, loaded

    height, width = photo.depth.shape
    if not clicks or not all(0 <= x < width and 0 <= y < height for x, y in clicks):
        raise InputError(f"The clicks are {list(clicks)}; give at least one inside {width} x {height} pixels.")
    network = loaded(ClickNet, Path(weights) if str(weights) else WEIGHTS)
    scale = SIDE / max(height, width)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    whole = ClickMaps(*(np.ascontiguousarray(v, np.float32) for v in photo))
    rgb, normal = (np.asarray(cv2.resize(v, size, interpolation=way)) for v in (whole.rgb, whole.normal))
    depth = np.asarray(cv2.resize(whole.depth, size, interpolation=cv2.INTER_NEAREST))
    places = [(min(int((x + 0.5) * scale), size[0] - 1), min(int((y + 0.5) * scale), size[1] - 1)) for x, y in clicks]
    maps = features(rgb, unit(normal), depth, places)
    below, beside = -maps.shape[1] % STRIDE, -maps.shape[2] % STRIDE
    padded = torch.from_numpy(np.pad(maps, ((0, 0), (0, below), (0, beside)), mode="edge"))[None]
    mirrored = padded.flip(-1)
    mirrored[:, NORMAL_X] *= -1
    with torch.inference_mode():
        both = (network(padded) + network(mirrored).flip(-1)) / 2
    share = both[0].sigmoid().numpy()[: maps.shape[1], : maps.shape[2]]
    return np.asarray(cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR))
