"""MatNet for users: any picture size in, maps of that size out."""

from __future__ import annotations

import cv2
import numpy as np
import torch
from torch.nn import functional as F

from materialist.predict.matnet.encoder import PATCH
from materialist.predict.matnet.network import MatNet
from materialist.types import Array

INPUT_SIZE = 518
"""Shorter side that the network sees, as published (and as its encoder was trained)."""


def infer(network: MatNet, linear: Array, *, input_size: int = INPUT_SIZE) -> dict[str, Array]:
    """The network's raw outputs for a picture [H, W, 3] float32 linear, about [0, 1], as the published inference has
    them: albedo, normal [H, W, 3] and roughness, metallic, depth [H, W], float32; see `MatNet.forward` for ranges.

    The picture is resized (bicubic, aspect kept) so that its shorter side is at least `input_size` >= 14 and both sides
    are multiples of 14; the outputs are resized back (bilinear, corners aligned), the normals not normalised again.
    """
    height, width = linear.shape[:2]
    rows, columns = network_size(height, width, input_size)
    small = cv2.resize(linear, (columns, rows), interpolation=cv2.INTER_CUBIC)
    parameter = next(network.parameters())
    image = torch.from_numpy(small).permute(2, 0, 1)[None].to(parameter.device, torch.float32)
    with torch.inference_mode():
        outputs = network.eval()(image)
        full = {
            name: F.interpolate(x, (height, width), mode="bilinear", align_corners=True)[0]
            for name, x in outputs.items()
        }
    return {name: np.ascontiguousarray(x.permute(1, 2, 0).squeeze(-1).cpu().numpy()) for name, x in full.items()}


def network_size(height: int, width: int, input_size: int = INPUT_SIZE) -> tuple[int, int]:
    """(rows, columns) that the network sees: the shorter side at least `input_size`, both multiples of 14."""
    scale = max(input_size / height, input_size / width)

    def fitted(side: int) -> int:
        near = round(scale * side / PATCH) * PATCH
        return near if near >= input_size else int(np.ceil(scale * side / PATCH)) * PATCH

    return fitted(height), fitted(width)


def planar_depth(output: Array) -> Array:
    """Planar depth [H, W] > 0 from the published network's depth output [H, W]: 2 max - output, as its pipeline does
    it.

    The decoder starts from Depth Anything, and the output still falls with distance, in no fixed unit. The far side is
    then at most twice as far as the near one: a relief with the right order, not a measurement.
    """
    top = float(output.max())
    if top <= 0:  # nothing was seen: a flat wall
        return np.ones_like(output, np.float32)
    return (2 * top - output).astype(np.float32)
