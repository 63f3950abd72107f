"""From clicks on a photo, or a box in it, to the object that is meant."""

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from materialist.camera import unit
from materialist.errors import InputError
from materialist.predict import resample
from materialist.predict.clicks.features import NORMAL_X, Box, click_features
from materialist.types import Array

WEIGHTS = Path(__file__).parent / "weights.safetensors"
"""The weights that ship with the package; docs/training.md says how they were made."""
SIDE = 224
"""Longer side at which the network sees the photo, pixels."""


def object_likelihood(
    rgb: Array,
    normal: Array,
    depth: Array,
    clicks: Sequence[tuple[int, int]] = (),
    *,
    box: Box | None = None,
    weights: str | Path = "",
) -> Array:
    """[H, W] float32 in [0, 1]: how likely each pixel belongs to the object that all clicks lie on, or in the box.

    The mean over the photo and its mirror image. rgb: [H, W, 3] sRGB in [0, 1]. normal: [H, W, 3] unit. depth: [H, W]
    planar, 0 = no surface. clicks: (column, row), at least one where there is no box. weights: a file of
    `materialist train clicks`, or "" for those in the package. Raises InputError for neither or both, or for a click or
    a box that is not inside, WeightsError.
    """
    import torch

    from materialist.predict.clicks.network import ClickNet
    from materialist.predict.network import STRIDE, loaded

    height, width = depth.shape
    if bool(clicks) == (box is not None) or not all(
        0 <= x < width and 0 <= y < height for x, y in clicks
    ):
        raise InputError(
            f"The clicks are {list(clicks)}; give some inside {width} x {height} pixels, or a box."
        )
    if box is not None and not (0 <= box[0] < box[2] <= width and 0 <= box[1] < box[3] <= height):
        raise InputError(
            f"The box is {box}; give (x0, y0, x1, y1) inside {width} x {height} pixels."
        )
    # --- The photo and its maps at the network's size; clicks and box with them ---
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
    small_box = None if box is None else _scaled(box, scale, (columns, rows))
    maps = click_features(
        resample.values(rgb, size),
        unit(resample.values(normal, size)),
        small_depth,
        small_clicks,
        small_box,
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


def _scaled(box: Box, scale: float, size: tuple[int, int]) -> Box:
    """The box in a picture that is `scale` times as large, of that (width, height); at least a pixel."""
    x0, y0 = (min(int(box[k] * scale), size[k] - 1) for k in (0, 1))
    x1, y1 = (
        min(max(round(box[2 + k] * scale), low + 1), size[k]) for k, low in ((0, x0), (1, y0))
    )
    return x0, y0, x1, y1
