"""MatNet trained as the paper says (sections "Material Prediction Network" and "Implementation Details")."""

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.camera import unit
from materialist.errors import WeightsError
from materialist.predict.bundled.network import srgb
from materialist.predict.matnet.network import PATCH, MatNet, Size
from materialist.predict.matnet.predictor import infer_matnet
from materialist.predict.weights import read_state
from materialist.types import Array, Materials, Prediction
from materialist_lab.data.samples import Sample, Source
from materialist_lab.metrics.lpips import backbone
from materialist_lab.train import losses
from materialist_lab.train.maps import MapsTask
from materialist_lab.train.task import Batch, Recipe

RECIPE = Recipe(
    side=512,
    batch=8,
    rate=1e-5,
    weight_decay=0.01,
    betas=(0.9, 0.999),
    warm_up=0,
    last_rate=1.0,
    ema=0.0,
    bfloat16=False,
    clip=1e9,
)
"""Paper, Implementation Details: AdamW, learning rate 1e-5, 512 x 512 crops. Where the paper says nothing (batch,
decay of weights and of the rate), torch's default or a constant."""
MAPS = ("image", "albedo", "roughness", "metallic", "normal", "depth", "mask")
"""What is learned from."""
DEPTH_DECODER_LEARNS = ("refinenet1", "refinenet2", "refinenet3", "refinenet4")
"""Parts of the depth decoder that learn (paper: "the last four layers of the RefineNet"); its rest is frozen."""


class PaperTask(MapsTask):
    """MatNet: LPIPS + L1 for albedo, L1 for roughness and metallic, SiLog for depth, cosine for normals."""

    def __init__(
        self,
        source: Source,
        recipe: Recipe = RECIPE,
        *,
        init: Path | None = None,
        score_samples: int = 12,
        size: str | Size = "vitb",
    ):
        """`init`: a Depth Anything or DINOv2 checkpoint; it gives what it has, the rest starts at random."""
        self.size = size
        self.lpips = backbone("vgg")
        # --- What the log says at the start: what differs from the paper ---
        start = (
            "MatNet starts from random weights; the paper starts from Depth Anything (--init FILE)."
            if init is None
            else f"MatNet starts from {init}."
        )
        perceptual = (
            "Albedo: L1 and LPIPS (VGG)."
            if self.lpips is not None
            else "Albedo: L1 and gradients at four scales in place of LPIPS, which is not installed."
        )
        self.notes = (perceptual, start)
        super().__init__(source, recipe, init=init, score_samples=score_samples)

    def make(self) -> MatNet:
        """MatNet, its encoder frozen and of its depth decoder all but the RefineNet layers."""
        network = MatNet(self.size)
        freeze(network)
        return network

    def network(self) -> MatNet:
        """MatNet with what the checkpoint in `init` has of it."""
        network = self.make()
        if self.init is not None:
            load_start(network, self.init)
        return network

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """The paper's augmentation and no other: a random vertical flip and a random side x side crop; [C, H, W]."""
        # --- A sample at least as large as the crop ---
        sample = self.read(index)
        maps = {
            name: torch.from_numpy(np.atleast_3d(getattr(sample, name))).permute(2, 0, 1)
            for name in MAPS
        }
        if (factor := side / min(sample.depth.shape)) > 1:
            maps = enlarged(maps, [max(side, round(edge * factor)) for edge in sample.depth.shape])
        # --- Crop ---
        height, width = maps["depth"].shape[1:]
        top = int(rng.integers(0, height - side + 1))
        left = int(rng.integers(0, width - side + 1))
        maps = {
            name: values[:, top : top + side, left : left + side] for name, values in maps.items()
        }
        # --- Vertical flip; y of the normals changes sign ---
        if rng.random() < 0.5:
            maps = {name: values.flip(1) for name, values in maps.items()}
            maps["normal"][1] *= -1
        return {
            name: values.numpy()
            for name, values in (maps | {"image": maps["image"].clamp(0, 1)}).items()
        }

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        # The encoder takes whole patches: the picture goes in resized, the maps come back.
        image = batch["image"]
        mask = batch["mask"]
        height, width = image.shape[-2:]
        size = _patches(height), _patches(width)
        out = network(F.interpolate(image, size, mode="bicubic", align_corners=False).clamp(min=0))
        out = {
            k: F.interpolate(v, (height, width), mode="bilinear", align_corners=False)
            for k, v in out.items()
        }
        # The paper's terms, each with weight 1.
        albedo = batch["albedo"]
        return {
            "albedo": losses.l1(out["albedo"], albedo, mask)
            + self._perceptual(out["albedo"], albedo, mask),
            "roughness": losses.l1(out["roughness"], batch["roughness"], mask),
            "metallic": losses.l1(out["metallic"], batch["metallic"], mask),
            "normal": losses.cosine(out["normal"], batch["normal"], mask),
            "depth": losses.silog(out["depth"], batch["depth"], mask),
        }

    def _perceptual(self, predicted: Tensor, true: Tensor, mask: Tensor) -> Tensor:
        """LPIPS of sRGB-encoded albedo [B, 3, H, W], the truth where the mask is 0; or gradients in its place."""
        predicted = srgb(predicted)
        true = srgb(true)
        if self.lpips is None:
            return losses.gradient(predicted, true, mask)
        # LPIPS sees neighbourhoods: what is masked out must not differ. It expects [-1, 1].
        kept = torch.where(mask > 0, predicted, true)
        return self.lpips.to(predicted.device)(2 * kept - 1, 2 * true - 1).mean()

    def predict(self, network: nn.Module, sample: Sample) -> Prediction:
        """The maps at the sample's size. A network trained here answers with depth itself, as its loss asks."""
        assert isinstance(network, MatNet)
        maps = infer_matnet(
            network, np.clip(sample.image, 0, 1), input_size=_patches(min(sample.depth.shape))
        )
        materials = Materials(
            **{name: np.clip(maps[name], 0, 1) for name in ("albedo", "roughness", "metallic")}
        )
        return Prediction(
            materials, unit(maps["normal"]), np.maximum(maps["depth"], losses.SILOG_RANGE[0])
        )


def enlarged(maps: dict[str, Tensor], size: list[int]) -> dict[str, Tensor]:
    """The maps [C, h, w] at that (height, width): colours are interpolated, geometry is taken from the nearest pixel.

    Albedo, roughness and metallic are means over what has a surface: the sky has none to mix in.
    """

    def smooth(values):
        return F.interpolate(values[None], size, mode="bilinear")[0]

    def nearest(values):
        return F.interpolate(values[None], size, mode="nearest-exact")[0]

    # Normalised convolution: sum of values over sum of shares.
    mask = maps["mask"]
    share = smooth(maps["mask"]).clamp(min=1e-6)
    resized = {name: nearest(maps[name]) for name in ("normal", "depth", "mask")}
    resized |= {
        name: smooth(maps[name] * mask) / share for name in ("albedo", "roughness", "metallic")
    }
    return resized | {"image": smooth(maps["image"])}


def freeze(network: MatNet) -> None:
    """Let learn what the paper lets learn: the material decoder, and the RefineNet layers of the depth decoder."""
    for name, parameter in network.named_parameters():
        # Everything else, the encoder among it, is frozen.
        refine = any(f".{layer}." in name for layer in DEPTH_DECODER_LEARNS)
        learns = name.startswith("material_head.") or (name.startswith("depth_head.") and refine)
        parameter.requires_grad_(learns)


def load_start(network: MatNet, path: Path) -> list[str]:
    """Copy what a Depth Anything or DINOv2 checkpoint has in common with MatNet; returns the names copied.

    DINOv2 gives the encoder (its names lack the prefix 'pretrained.'), Depth Anything also the depth decoder, which the
    material decoder starts as well where shapes agree. Raises WeightsError when there is no encoder in the file.
    """
    stored = read_state(path)
    # --- DINOv2 has the encoder alone ---
    if "cls_token" in stored:
        stored = {f"pretrained.{name}": tensor for name, tensor in stored.items()}
    # --- What fits by name and shape ---
    state = network.state_dict()
    start = {
        name: tensor
        for name, tensor in stored.items()
        if name in state and tensor.shape == state[name].shape
    }
    # --- The material decoder starts from the depth decoder ---
    for name in [n for n in start if n.startswith("depth_head.")]:
        twin = name.replace("depth_head.", "material_head.", 1)
        if twin in state and state[twin].shape == start[name].shape:
            start[twin] = start[name]
    if not any(name.startswith("pretrained.") for name in start):
        raise WeightsError(
            f"{path} has no encoder that fits MatNet; give a Depth Anything or DINOv2 ViT-B/14 file."
        )
    state |= {name: tensor.to(torch.float32) for name, tensor in start.items()}
    network.load_state_dict(state)
    return sorted(start)


def _patches(side: int) -> int:
    """A side of a picture, pixels, rounded to whole patches of the encoder."""
    return max(PATCH, round(side / PATCH) * PATCH)
