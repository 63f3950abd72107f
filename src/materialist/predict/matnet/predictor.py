"""The predictor `matnet[:FILE|:HUB_ID]`: the paper's network with published or own weights (docs/predictors.md)."""

from collections.abc import Callable, Collection
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.errors import WeightsError
from materialist.predict.matnet.network import PATCH, SIZES, MatNet
from materialist.predict.models import locate, weights_file
from materialist.predict.protocol import MapSet, Predictor, on_gpu
from materialist.predict.weights import load_weights, metadata, read_state, verify_file
from materialist.types import Array, Photo

INPUT_SIZE = 518
"""Shorter side that the network sees, as published (and as its encoder was trained)."""


class MatNetPredictor(Predictor):
    """MatNet with weights from a file, a folder, or a model that was downloaded from a hub; "": the published ones.

    `input_size`: shorter side that it sees, pixels. Raises WeightsError for missing, damaged or other weights.
    """

    def __init__(
        self, where: str | Path = "", *, device: str = "auto", input_size: int = INPUT_SIZE
    ):
        path = weights_file(locate(str(where), "matnet"))
        digest = verify_file(path)
        state = read_state(path)
        # The published network answers with something that falls with distance; ours with depth.
        self.trained_here = metadata(path).get("format") == MatNet.FORMAT
        width = state["pretrained.cls_token"].shape[-1] if "pretrained.cls_token" in state else None
        # An unknown width is compared with the published size, so that the message says what was expected.
        size = next((name for name, s in SIZES.items() if s.width == width), "vitb")
        # The start values are replaced at once: the caller's random numbers must not move on.
        with torch.random.fork_rng(devices=[]):
            network = MatNet(size)
        load_weights(network, state, path)
        self.network = network.to("cuda" if on_gpu(device) else "cpu").eval()
        self.input_size = input_size
        self.name = f"matnet {size} {path.name} sha256:{digest[:16]}"

    def parts(
        self, photo: Photo, names: Collection[str], *, seed: int = 0, normal: Array | None = None
    ) -> MapSet:
        """The wanted of the network's maps, as docs/predictors.md has them; `seed` changes nothing.

        It sees linear values, as in training. For depth see `planar_depth`; weights of `train matnet --config paper`
        answer with depth itself, as their loss asks.
        """
        maps = infer_matnet(self.network, photo.linear, input_size=self.input_size)
        if not all(np.isfinite(values).all() for values in maps.values()):
            raise WeightsError(
                f"MatNet gave values that are not finite; check the weights ({self.name})."
            )
        # Resizing shortens normals between two directions; where hardly anything is left they
        # are unknown.
        length = np.linalg.norm(maps["normal"], axis=-1, keepdims=True)
        result = {name: np.clip(maps[name], 0, 1) for name in ("albedo", "roughness", "metallic")}
        result["normal"] = np.where(
            length > 1e-3, maps["normal"] / np.maximum(length, 1e-3), 0
        ).astype(np.float32)
        result["depth"] = (
            np.maximum(maps["depth"], 1e-3) if self.trained_here else planar_depth(maps["depth"])
        )
        return MapSet({name: result[name] for name in names}, dict.fromkeys(names, self.name))


def infer_matnet(
    network: MatNet, linear: Array, *, input_size: int = INPUT_SIZE
) -> dict[str, Array]:
    """The network's raw outputs for a picture [H, W, 3] float32 linear, about [0, 1], as the published inference has
    them: albedo, normal [H, W, 3] and roughness, metallic, depth [H, W], float32; see `MatNet.forward` for ranges, and
    `at_network_size`. The normals are not normalised again.
    """
    return at_network_size(network.eval(), linear, next(network.parameters()).device, input_size)


def at_network_size(
    run: Callable[[Tensor], dict[str, Tensor]],
    picture: Array,
    device: Any,
    input_size: int = INPUT_SIZE,
) -> dict[str, Array]:
    """What `run` makes of a picture [H, W, 3] at the size of its encoder, as maps [H, W, C] or [H, W] float32.

    The picture is resized (bicubic, aspect kept) so that its shorter side is at least `input_size` >= 14 and both sides
    are multiples of 14; the outputs [1, C, h, w] are resized back (bilinear, corners aligned).
    """
    height, width = picture.shape[:2]
    rows, columns = network_size(height, width, input_size)
    small = cv2.resize(picture, (columns, rows), interpolation=cv2.INTER_CUBIC)
    image = torch.from_numpy(small).permute(2, 0, 1)[None].to(device, torch.float32)
    with torch.inference_mode():
        outputs = run(image)
        full = [
            F.interpolate(x, (height, width), mode="bilinear", align_corners=True)[0]
            for x in outputs.values()
        ]
    maps = (
        np.ascontiguousarray(x.permute(1, 2, 0).squeeze(-1).float().cpu().numpy()) for x in full
    )
    return dict(zip(outputs, maps))


def network_size(height: int, width: int, input_size: int = INPUT_SIZE) -> tuple[int, int]:
    """(rows, columns) that the network sees: the shorter side at least `input_size`, both multiples of 14."""
    scale = max(input_size / height, input_size / width)

    def fitted(side: int) -> int:
        # Rounded to whole patches, but never below the size that was asked for.
        near = round(scale * side / PATCH) * PATCH
        return near if near >= input_size else int(np.ceil(scale * side / PATCH)) * PATCH

    return fitted(height), fitted(width)


def planar_depth(output: Array) -> Array:
    """Planar depth [H, W] > 0 from the published network's output [H, W]: 2 max - output, as its pipeline does it.

    The output falls with distance, in no fixed unit: this is a relief with the right order, not a measurement.
    """
    top = float(output.max())
    if top <= 0:  # nothing was seen: a flat wall
        return np.ones_like(output, np.float32)
    return (2 * top - output).astype(np.float32)
