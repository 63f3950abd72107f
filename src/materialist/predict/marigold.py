"""Marigold (Ke et al. 2025) through diffusers: albedo, roughness, metallic, normals and depth."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path

import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.errors import WeightsError
from materialist.predict import hub
from materialist.predict.device import on_gpu
from materialist.predict.models import locate
from materialist.predict.protocol import MapSet, MixedPredictor, Predictor
from materialist.predict.relative import planar
from materialist.types import Array, Photo

GIVES = {
    "MarigoldIntrinsicsPipeline": ("albedo", "roughness", "metallic"),
    "MarigoldNormalsPipeline": ("normal",),
    "MarigoldDepthPipeline": ("depth",),
}
"""Pipeline class, as model_index.json names it -> the maps it gives."""
MODELS = ("marigold-appearance", "marigold-normals", "marigold-depth")
"""The published models, in the order of `GIVES`."""


def open_marigold(where: str = "", *, device: str = "auto") -> Predictor:
    """The Marigold model in a folder or of a hub id; all maps from the three published ones where `where` is "".

    Raises WeightsError where `where` is no Marigold model on this machine.
    """
    if where:
        return Marigold(where, GIVES[_pipeline_class(locate(where, ""))], device=device)
    parts = {model: Marigold(model, gives, device=device) for model, gives in zip(MODELS, GIVES.values())}
    return MixedPredictor({name: model for model, part in parts.items() for name in part.gives}, parts)


class Marigold(hub.HubPredictor):
    """One Marigold model: a folder with a pipeline of diffusers or a hub id, and the maps that it gives."""

    libraries = ("diffusers", "transformers")

    def __init__(self, where: str, gives: tuple[str, ...], *, device: str = "auto"):
        super().__init__(where, device=device)
        self.gives, self.source = gives, f"marigold ({where})"

    def parts(self, photo: Photo, wanted: Collection[str], *, seed: int = 0, normal: Array | None = None) -> MapSet:
        """The wanted maps at the photo's size. The model sees sRGB values; equal seeds start from equal noise."""
        import torch

        folder = locate(self.where, "")
        source = f"marigold ({folder.name.replace('--', '/')}){hub.checked(folder)}"
        kind, gpu = _pipeline_class(folder), on_gpu(self.device)
        pipeline = hub.pipeline(kind, folder, gpu)
        generator = torch.Generator("cuda" if gpu else "cpu").manual_seed(seed)
        output = pipeline(linear_to_srgb(photo.linear)[None], generator=generator, output_type="np").prediction
        notes: tuple[str, ...] = ()
        if kind == "MarigoldIntrinsicsPipeline":
            maps = appearance(output, pipeline.target_properties or {})
        elif kind == "MarigoldNormalsPipeline":
            maps = {"normal": unit_normals(output[0])}
        else:
            inverse = pipeline.config.prediction_type == "disparity"
            depth, note, notes = planar(output[0, ..., 0], photo.camera, normal, inverse=inverse, name=self.name)
            maps, source = {"depth": depth}, source + note
        lacking = [name for name in wanted if name not in maps]
        if lacking:
            raise WeightsError(f"{folder} gives {', '.join(maps)}, not {lacking[0]}; use an 'appearance' model for it.")
        return MapSet({name: maps[name] for name in wanted}, dict.fromkeys(wanted, source), notes)


def appearance(output: Array, properties: dict) -> dict[str, Array]:
    """Albedo, and roughness and metallic where they are among the targets, of output [T, H, W, 3] in [0, 1].

    `properties`: the pipeline's `target_properties`: the order of the targets, what their channels are
    (`sub_target_names`), and whether the albedo is linear or sRGB (`prediction_space`; sRGB unless said).
    """
    maps: dict[str, Array] = {}
    ours = {"metallicity": "metallic", "roughness": "roughness"}
    for name, picture in zip(properties.get("target_names", ("albedo",)), output):
        about = properties.get(name) or {}
        channels = about.get("sub_target_names")
        if channels:
            maps |= {ours[part]: picture[..., k] for k, part in enumerate(channels) if part in ours}
        elif name == "albedo":
            maps[name] = picture if about.get("prediction_space") == "linear" else srgb_to_linear(picture)
    return {name: np.ascontiguousarray(np.clip(values, 0, 1), np.float32) for name, values in maps.items()}


def unit_normals(output: Array) -> Array:
    """[H, W, 3] unit normals. Marigold's frame is ours: +X right, +Y up, +Z to the viewer; interpolation shortens."""
    length = np.linalg.norm(output, axis=-1, keepdims=True)
    ahead = np.array([0, 0, 1], np.float32)
    return np.where(length > 1e-3, output / np.maximum(length, 1e-3), ahead).astype(np.float32)


def _pipeline_class(folder: Path) -> str:
    """The kind of pipeline in a folder. Raises WeightsError unless it is a Marigold."""
    try:
        kind = json.loads((folder / "model_index.json").read_text("utf-8")).get("_class_name")
    except (OSError, ValueError, AttributeError) as error:
        raise WeightsError(f"{folder} holds no readable model_index.json, as diffusers writes it ({error}).") from error
    if kind not in GIVES:
        raise WeightsError(f"{folder} holds a {kind}; Marigold models are {', '.join(GIVES)}.")
    return kind
