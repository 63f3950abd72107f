"""Depth Anything V2 (Yang et al. 2024) through transformers: depth, relative or metric."""

from __future__ import annotations

from collections.abc import Collection

import cv2
import numpy as np

from materialist.color import linear_to_srgb
from materialist.predict import hub
from materialist.predict.device import on_gpu
from materialist.predict.models import locate
from materialist.predict.protocol import MapSet
from materialist.predict.relative import planar
from materialist.types import Array, Photo

MEAN, DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of sRGB values in [0, 1], as the network was trained."""


class DepthAnything(hub.HubPredictor):
    """Gives depth alone; by default Depth Anything V2 Small."""

    gives = ("depth",)
    default, libraries = "depth-anything", ("transformers",)

    def __init__(self, where: str = "", *, device: str = "auto"):
        super().__init__(where, device=device)
        self.source = f"depth-anything ({where or 'V2 Small'})"

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> MapSet:
        """Planar depth. The network sees sRGB values; a metric model's depth is in metres and taken as it is, a
        relative one gives inverse depth without scale and shift, see `relative.from_relative`.
        """
        folder = locate(self.where, self.default)
        digest = hub.checked(folder)
        model = hub.load(hub.library("transformers").DepthAnythingForDepthEstimation, folder)
        values = _run(model, photo.linear, on_gpu(self.device))
        if model.config.depth_estimation_type == "metric":
            return MapSet({"depth": np.maximum(values, 1e-3)}, {"depth": f"{self.name}{digest}, metric"})
        depth, note, warnings = planar(values, photo.camera, normal, inverse=True, name=self.name)
        return MapSet({"depth": depth}, {"depth": f"{self.name}{digest}{note}"}, warnings)


def _run(model, linear: Array, gpu: bool) -> Array:
    """The network's output [H, W] for a linear picture [H, W, 3]: the shorter side is seen at 518 pixels."""
    import torch
    from torch.nn import functional as F

    from materialist.predict.matnet.inference import network_size

    height, width = linear.shape[:2]
    rows, columns = network_size(height, width)
    small = cv2.resize(linear_to_srgb(linear), (columns, rows), interpolation=cv2.INTER_CUBIC)
    pixels = ((small - MEAN) / DEVIATION).astype(np.float32)
    model = model.to("cuda" if gpu else "cpu", torch.float32).eval()
    image = torch.from_numpy(pixels).permute(2, 0, 1)[None].to(model.device)
    with torch.inference_mode():
        output = model(pixel_values=image).predicted_depth[:, None]
        full = F.interpolate(output, (height, width), mode="bilinear", align_corners=True)
    return full[0, 0].float().cpu().numpy()
