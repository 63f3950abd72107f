"""From clicks on a photo to the object that they lie on."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import unit
from materialist.errors import InputError
from materialist.predict import resample
from materialist.predict.clicks.features import NORMAL_X, features
from materialist.types import Array

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""
SIDE = 224
"""Longer side at which the network sees the photo, pixels."""


def object_at(
    rgb: Array, normal: Array, depth: Array, clicks: Sequence[tuple[int, int]], *, weights: str | Path = ""
) -> Array:
    """[H, W] float32 in [0, 1]: how likely each pixel belongs to the object that all clicks lie on.

    The mean over the photo and its mirror image. rgb: [H, W, 3] sRGB in [0, 1]. normal: [H, W, 3] unit. depth: [H, W]
    planar, 0 = no surface. clicks: (column, row), at least one. weights: a file of `materialist train clicks`, or ""
    for those in the package. Raises InputError for no click or one outside, WeightsError.
    """
    import torch

    from materialist.predict.clicks.network import ClickNet
    from materialist.predict.network import STRIDE, loaded

    height, width = depth.shape
    if not clicks or not all(0 <= x < width and 0 <= y < height for x, y in clicks):
        raise InputError(f"The clicks are {list(clicks)}; give at least one inside {width} x {height} pixels.")
    network = loaded(ClickNet, Path(weights) if str(weights) else WEIGHTS)
    scale = SIDE / max(height, width)
    rows, columns = size = resample.with_longer_side(depth.shape, SIDE)
    whole = [np.ascontiguousarray(v, np.float32) for v in (rgb, normal, depth)]
    nearest = np.asarray(cv2.resize(whole[2], (columns, rows), interpolation=cv2.INTER_NEAREST))
    places = [(min(int((x + 0.5) * scale), columns - 1), min(int((y + 0.5) * scale), rows - 1)) for x, y in clicks]
    maps = features(resample.values(whole[0], size), unit(resample.values(whole[1], size)), nearest, places)
    below, beside = -maps.shape[1] % STRIDE, -maps.shape[2] % STRIDE
    padded = torch.from_numpy(np.pad(maps, ((0, 0), (0, below), (0, beside)), mode="edge"))[None]
    mirrored = padded.flip(-1)
    mirrored[:, NORMAL_X] *= -1
    with torch.inference_mode():
        both = (network(padded) + network(mirrored).flip(-1)) / 2
    share = both[0].sigmoid().numpy()[: maps.shape[1], : maps.shape[2]]
    return np.asarray(cv2.resize(share, (width, height), interpolation=cv2.INTER_LINEAR))
