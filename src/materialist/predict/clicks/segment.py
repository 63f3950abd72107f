"""From clicks on a photo to the object that is meant."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import unit
from materialist.errors import InputError
from materialist.predict import resample
from materialist.predict.clicks.features import NORMAL_X, click_features
from materialist.threads import fixed_threads
from materialist.types import Array

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""
SIDE = 224
"""Longer side at which the network sees the photo, pixels."""


@fixed_threads()
def object_likelihood(
    rgb: Array,
    normal: Array,
    depth: Array,
    clicks: Sequence[tuple[int, int]],
    *,
    weights: str | Path = "",
) -> Array:
    """[H, W] float32 in [0, 1]: how likely each pixel belongs to the object that all clicks lie on.

    The mean over the photo and its mirror image. rgb: [H, W, 3] sRGB in [0, 1]. normal: [H, W, 3] unit. depth: [H, W]
    planar, 0 = no surface. clicks: (column, row), at least one. weights: a file of `materialist train clicks`, or ""
    for those in the package. Raises InputError for no click or one that is not inside, WeightsError.
    """
    import torch

    from materialist.predict.clicks.network import ClickNet
    from materialist.predict.network import STRIDE, loaded

    height, width = depth.shape
    if not clicks or not all(0 <= x < width and 0 <= y < height for x, y in clicks):
        raise InputError(
            f"The clicks are {list(clicks)}; give some inside {width} x {height} pixels."
        )
    # --- The photo, its maps and the clicks at the network's size ---
    network = loaded(ClickNet, Path(weights) if str(weights) else WEIGHTS)
    scale = SIDE / max(height, width)
    rows, columns = size = resample.with_longer_side(depth.shape, SIDE)
    rgb = np.ascontiguousarray(rgb, np.float32)
    normal = np.ascontiguousarray(normal, np.float32)
    depth = np.ascontiguousarray(depth, np.float32)
    # Depth by the nearest pixel: a mean across an edge is a depth that nothing has.
    small_depth = np.asarray(cv2.resize(depth, (columns, rows), interpolation=cv2.INTER_NEAREST))
    small_clicks = [
        (min(int((x + 0.5) * scale), columns - 1), min(int((y + 0.5) * scale), rows - 1))
        for x, y in clicks
    ]
    maps = click_features(
        resample.values(rgb, size),
        unit(resample.values(normal, size)),
        small_depth,
        small_clicks,
    )
    # --- The network on the picture and its mirror image, padded to whole strides ---
    pad_rows = -maps.shape[1] % STRIDE
    pad_columns = -maps.shape[2] % STRIDE
    padding = ((0, 0), (0, pad_rows), (0, pad_columns))
    padded = torch.from_numpy(np.pad(maps, padding, mode="edge"))[None]
    mirrored = padded.flip(-1)
    mirrored[:, NORMAL_X] *= -1
    with torch.inference_mode():
        logits = (network(padded) + network(mirrored).flip(-1)) / 2
    # --- Back to the photo's size ---
    likelihood = logits[0].sigmoid().numpy()[:rows, :columns]
    return np.asarray(cv2.resize(likelihood, (width, height), interpolation=cv2.INTER_LINEAR))
