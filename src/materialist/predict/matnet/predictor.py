"""The predictor `matnet[:FILE|:HUB_ID]`: the paper's network with published or own weights (docs/predictors.md)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch

from materialist.errors import WeightsError
from materialist.predict.device import on_gpu
from materialist.predict.matnet.inference import INPUT_SIZE, infer, planar_depth, trained_depth
from materialist.predict.matnet.network import SIZES, MatNet
from materialist.predict.models import hub_model, is_hub_id, require, weights_file
from materialist.predict.weights import INSTEAD, load_weights, metadata, read_content, state_of, verify_file
from materialist.types import Materials, Photo, Prediction

FORMAT = "materialist-matnet-1"
"""What a file of `train export` calls itself in its metadata: its depth output is depth."""


class MatNetPredictor:
    """MatNet with weights from a file, a folder, or a model that was downloaded from a hub.

    Args:
        where: a file or folder of weights, a hub id (owner/name), or "" for the published weights.
        device: 'auto', 'cpu' or 'cuda'.
        input_size: shorter side that the network sees, pixels.

    Raises:
        WeightsError: the weights are missing, damaged, or for another network.
    """

    def __init__(self, where: str | Path = "", *, device: str = "auto", input_size: int = INPUT_SIZE):
        path = _locate(str(where))
        digest = verify_file(path)
        content = read_content(path)
        state = state_of(content, path)
        self.trained_here = _trained_here(content, path)
        width = state["pretrained.cls_token"].shape[-1] if "pretrained.cls_token" in state else None
        # An unknown width is compared with the published size, so that the message says what was expected.
        size = next((name for name, s in SIZES.items() if s.width == width), "vitb")
        with torch.random.fork_rng(devices=[]):  # the start values are replaced; nobody's random numbers change
            network = MatNet(size)
        load_weights(network, state, path)
        self.network = network.to("cuda" if on_gpu(device) else "cpu").eval()
        self.input_size = input_size
        self.source = f"matnet {size} {path.name} sha256:{digest[:16]}"

    @property
    def name(self) -> str:
        """What the report calls it: size, file and the start of its checksum."""
        return self.source

    def predict(self, photo: Photo, *, seed: int = 0) -> Prediction:
        """The network's maps at the photo's size; `seed` changes nothing.

        The network sees linear values, as in training (InteriorVerse). Its albedo is linear, its normals are in our
        camera frame already (the published renderer puts its camera at the origin, looking down -Z, and uses them as
        they are), roughness is perceptual. Materials are clipped to [0, 1]; for depth see `planar_depth`, and
        `trained_depth` for weights of `train matnet --config paper`.
        """
        maps = infer(self.network, photo.linear, input_size=self.input_size)
        if not all(np.isfinite(values).all() for values in maps.values()):
            raise WeightsError(f"MatNet gave values that are not finite; check the weights ({self.source}).")
        length = np.linalg.norm(maps["normal"], axis=-1, keepdims=True)
        normal = np.where(length > 1e-3, maps["normal"] / np.maximum(length, 1e-3), np.array([0, 0, 1], np.float32))
        clipped = {k: np.clip(maps[k], 0, 1) for k in ("albedo", "roughness", "metallic")}
        depth = (trained_depth if self.trained_here else planar_depth)(maps["depth"])
        return Prediction(Materials(**clipped), normal.astype(np.float32), depth, predictor=self.name)


def _trained_here(content: object, path: Path) -> bool:
    """Whether the weights are a checkpoint of `train matnet --config paper`, or what `train export` wrote of one."""
    task = content.get("task") if isinstance(content, dict) else None
    if isinstance(task, dict):
        return task.get("name") == "paper"
    return path.suffix == ".safetensors" and metadata(path).get("format") == FORMAT


def _locate(where: str) -> Path:
    """The file of weights that `where` means. Raises WeightsError."""
    if not where:
        return weights_file(require(hub_model("matnet")), hub_model("matnet").main_file)
    path = Path(where).expanduser()
    if path.is_dir():
        return weights_file(path)
    if path.is_file():
        return path
    if is_hub_id(where):
        return weights_file(require(hub_model(where)))
    raise WeightsError(
        f"There is no file {where}; --predictor matnet:FILE needs MatNet's weights (a .safetensors or .pth file), "
        f"--predictor matnet alone the published ones (materialist models download matnet); or {INSTEAD}."
    )
