"""Masks at clicks or in a box, by MobileSAM (Zhang et al. 2023): SAM's decoder on an encoder distilled from SAM's.

Kirillov et al., "Segment Anything", 2023. One prompt may mean a part, a whole, or a group: it has three answers, each
with the IoU that the network expects of it.
"""

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from materialist.predict import resample
from materialist.predict.clicks.features import Box
from materialist.predict.onnx import run
from materialist.types import Array

ENCODER = Path(__file__).with_name("encoder.onnx")
DECODER = Path(__file__).with_name("decoder.onnx")
"""The networks that ship with the package; docs/training.md says where they come from."""
SIDE = 1024
"""Longer side of the picture that the encoder reads, pixels; the rest of the square is empty."""
MASK_SIDE = 256
"""Side of the decoder's masks."""
MEAN = np.array([123.675, 116.28, 103.53], np.float32) / 255
DEVIATION = np.array([58.395, 57.12, 57.375], np.float32) / 255
"""Of sRGB-encoded values in [0, 1], as the encoder was trained."""
NOTHING, POINT, FIRST_CORNER, SECOND_CORNER = -1, 1, 2, 3
"""SAM's labels of the places in a prompt."""
REMEMBERED = 4
"""Pictures whose embeddings are kept: encoding takes a second, decoding a tenth of one."""

_embeddings: OrderedDict[bytes, Array] = OrderedDict()
_LOCK = threading.Lock()


def masks(
    rgb: Array, clicks: Sequence[tuple[int, int]] = (), *, box: Box | None = None
) -> tuple[Array, Array]:
    """([3, H, W] float32 logits of three masks, [3] the IoU that the network expects of each).

    rgb: [H, W, 3] sRGB in [0, 1]. clicks: (column, row) on one object, or box: (x0, y0, x1, y1) around it. Raises
    SetupError, WeightsError: see `onnx.run`.
    """
    height, width = rgb.shape[:2]
    scale = SIDE / max(height, width)
    # --- The prompt, in pixels of the square; clicks are at pixel centres, corners between pixels ---
    if box is None:
        places = [(x + 0.5, y + 0.5) for x, y in clicks] + [(0.0, 0.0)]
        labels = [POINT] * len(clicks) + [NOTHING]
    else:
        places = [(box[0], box[1]), (box[2], box[3])]
        labels = [FIRST_CORNER, SECOND_CORNER]
    logits, scores = run(
        DECODER,
        {
            "embedding": embedding(rgb),
            "points": np.array(places, np.float32)[None] * np.float32(scale),
            "labels": np.array(labels, np.float32)[None],
        },
    )
    # --- Without the first mask, which is for prompts that mean one thing only, and without the empty rest ---
    rows, columns = resample.with_longer_side((height, width), MASK_SIDE)
    large = [
        cv2.resize(mask[:rows, :columns], (width, height), interpolation=cv2.INTER_LINEAR)
        for mask in logits[0, 1:]
    ]
    return np.stack(large), scores[0, 1:]


def embedding(rgb: Array) -> Array:
    """[1, 256, 64, 64] float32: what the encoder makes of rgb [H, W, 3] sRGB in [0, 1]; kept for later prompts."""
    levels = np.round(rgb * 255).astype(np.uint8)
    key = hashlib.sha256(repr(levels.shape).encode() + levels.tobytes()).digest()
    # The lock lets threads that ask for one photo wait for one encoding.
    with _LOCK:
        if key not in _embeddings:
            _embeddings[key] = _encoded(levels)
        _embeddings.move_to_end(key)
        while len(_embeddings) > REMEMBERED:
            _embeddings.popitem(last=False)
        return _embeddings[key]


def _encoded(levels: Array) -> Array:
    """The encoder's answer to a picture [H, W, 3] uint8 sRGB."""
    rows, columns = resample.with_longer_side(levels.shape[:2], SIDE)
    square = np.zeros((SIDE, SIDE, 3), np.float32)
    square[:rows, :columns] = resample.values(levels.astype(np.float32) / 255, (rows, columns))
    square[:rows, :columns] -= MEAN
    square[:rows, :columns] /= DEVIATION
    picture = np.ascontiguousarray(np.moveaxis(square, -1, 0))[None]
    return run(ENCODER, {"picture": picture}, once=True)[0]
