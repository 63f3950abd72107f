"""The predictor `matnet[:FILE|:HUB_ID]`: the paper's network with published or own weights (docs/predictors.md)."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import numpy as np
import torch

from materialist.errors import WeightsError
from materialist.predict.device import on_gpu
from materialist.predict.matnet.inference import INPUT_SIZE, infer, planar_depth
from materialist.predict.matnet.network import SIZES, MatNet
from materialist.predict.models import locate, weights_file
from materialist.predict.protocol import MapSet, Predictor
from materialist.predict.weights import load_weights, metadata, read_state, verify_file
from materialist.types import Array, Photo


class MatNetPredictor(Predictor):
    """MatNet with weights from a file, a folder, or a model that was downloaded from a hub; "": the published ones.

    `input_size`: shorter side that the network sees, pixels. Raises WeightsError for weights that are missing, damaged,
    or for another network.
    """

    def __init__(self, where: str | Path = "", *, device: str = "auto", input_size: int = INPUT_SIZE):
        path = weights_file(locate(str(where), "matnet"))
        digest = verify_file(path)
        state = read_state(path)
        self.trained_here = metadata(path).get("format") == MatNet.FORMAT  # its depth output is depth
        width = state["pretrained.cls_token"].shape[-1] if "pretrained.cls_token" in state else None
        # An unknown width is compared with the published size, so that the message says what was expected.
        size = next((name for name, s in SIZES.items() if s.width == width), "vitb")
        with torch.random.fork_rng(devices=[]):  # the start values are replaced; nobody's random numbers change
            network = MatNet(size)
        load_weights(network, state, path)
        self.network = network.to("cuda" if on_gpu(device) else "cpu").eval()
        self.input_size = input_size
        self.source = f"matnet {size} {path.name} sha256:{digest[:16]}"

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> MapSet:
        """The wanted of the network's maps; `seed` changes nothing.

        It sees linear values, as in training (InteriorVerse). Albedo is linear, normals are in our camera frame, as the
        published renderer uses them, roughness is perceptual; materials are clipped to [0, 1]. For depth see
        `planar_depth`; weights of `train matnet --config paper` answer with depth itself, as their loss asks.
        """
        maps = infer(self.network, photo.linear, input_size=self.input_size)
        if not all(np.isfinite(values).all() for values in maps.values()):
            raise WeightsError(f"MatNet gave values that are not finite; check the weights ({self.source}).")
        length = np.linalg.norm(maps["normal"], axis=-1, keepdims=True)
        found = {name: np.clip(maps[name], 0, 1) for name in ("albedo", "roughness", "metallic")}
        found["normal"] = np.where(length > 1e-3, maps["normal"] / np.maximum(length, 1e-3), 0).astype(np.float32)
        found["depth"] = np.maximum(maps["depth"], 1e-3) if self.trained_here else planar_depth(maps["depth"])
        return MapSet({name: found[name] for name in wanted}, dict.fromkeys(wanted, self.name))
