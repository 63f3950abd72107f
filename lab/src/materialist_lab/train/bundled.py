"""The bundled network, trained on procedural pictures."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from materialist.predict.bundled.inference import infer_bundled
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork, srgb
from materialist.types import Array, Prediction
from materialist_lab.data.samples import Sample, Source
from materialist_lab.train import losses
from materialist_lab.train.maps import MapsTask
from materialist_lab.train.pictures import AugmentSettings, stored, varied
from materialist_lab.train.task import Batch, Recipe

RECIPE = Recipe(
    side=256,
    batch=8,
    rate=1e-3,
    warm_up=300,
    last_rate=0.02,
    ema=0.999,
    growth=((0.3, 128), (0.75, 192)),
)
ARCHITECTURE = BundledArchitecture(encoder="lite2", patches="dinov2-vits14", light=16, spread=True)


@dataclass(frozen=True)
class BundledLoss:
    """Weights of the loss, all tuned by eye. L2 beside L1: in doubt the mean, not the median, is the better prior."""

    albedo_l1: float = 1.0
    albedo_l2: float = 2.0
    albedo_scaled: float = 2.0  # L1 after one factor a picture
    albedo_gradient: float = 0.7
    roughness_l1: float = 0.1
    roughness_l2: float = 3.0
    roughness_gradient: float = 0.2
    metallic: float = 1.0  # cross-entropy: metal is rare, and under L1 or L2 a sigmoid ends at 0 without a gradient
    metallic_gradient: float = 0.2
    normal: float = 1.5
    normal_gradient: float = 0.2
    depth: float = 1.5  # L1 of logarithms after their mean difference is removed
    depth_level: float = 0.1  # L1 of logarithms over the median, each at most 2
    depth_gradient: float = 1.5
    slopes: float = 0.5  # normals of the depth surface against the true ones
    mask: float = 0.2  # cross-entropy of where there is a surface
    light: float = 0.3  # negative log likelihood of the log radiance around the scene
    irradiance: float = 0.3  # relative error of its spherical harmonics
    spread: float = 0.1  # negative log likelihood of the errors; it moves its own head alone


class BundledTask(MapsTask):
    """The network that ships in the package."""

    new_parts = ("spread.", "patch_terms.")
    notes: tuple[str, ...] = (
        "Albedo is compared by L1, L2, gradients at four scales, and after one factor a picture; there is no LPIPS: "
        "its backbone is not part of this project.",
    )

    def __init__(
        self,
        source: Source,
        recipe: Recipe = RECIPE,
        *,
        init: Path | None = None,
        score_samples: int = 12,
        architecture: BundledArchitecture = ARCHITECTURE,
    ):
        super().__init__(source, recipe, init=init, score_samples=score_samples)
        self.architecture = architecture

    def make(self) -> BundledNetwork:
        network = BundledNetwork(self.architecture)
        return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """The sample as it is; `vary` changes it."""
        return stored(self.read(index))

    def vary(self, batch: Batch, side: int, random: torch.Generator) -> Batch:
        return varied(batch, side, AugmentSettings(), random)

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Losses of all maps; see `BundledLoss`."""
        image = batch["image"].contiguous(memory_format=torch.channels_last)
        out = network(image, batch["rays"])
        mask = batch["mask"]
        w = BundledLoss()
        albedo = srgb(batch["albedo"])
        depth = relative_log_depth(batch["depth"], mask)

        def gradient(name: str, true: Tensor | None = None) -> Tensor:
            return losses.gradient(out[name], batch[name] if true is None else true, mask)

        roughness = batch["roughness"]
        metallic = batch["metallic"]
        level = (out["depth"] - depth).abs().clamp(max=2)
        terms = {}
        if "spread" in out:
            true = {**batch, "albedo": albedo, "depth": depth}
            errors = losses.absolute_errors(out, true, mask)
            terms["spread"] = w.spread * losses.laplace(errors, out["spread"], mask)
        if "light" in out:
            likelihood, irradiance = losses.light(out["light"], batch["light"])
            terms |= {"light": w.light * likelihood, "irradiance": w.irradiance * irradiance}
        return terms | {
            "albedo": w.albedo_l1 * losses.l1(out["albedo"], albedo, mask)
            + w.albedo_l2 * losses.l2(out["albedo"], albedo, mask),
            "albedo_scaled": w.albedo_scaled
            * losses.scaled_l1(out["albedo"] ** 2.2, albedo**2.2, mask),
            "albedo_gradient": w.albedo_gradient * gradient("albedo", albedo),
            "roughness": w.roughness_l1 * losses.l1(out["roughness"], roughness, mask)
            + w.roughness_l2 * losses.l2(out["roughness"], roughness, mask)
            + w.roughness_gradient * gradient("roughness"),
            "metallic": w.metallic * losses.cross_entropy(out["metallic_logit"], metallic, mask)
            + w.metallic_gradient * gradient("metallic"),
            "normal": w.normal * losses.cosine(out["normal"], batch["normal"], mask),
            "normal_gradient": w.normal_gradient * gradient("normal"),
            "depth": w.depth * losses.centred_l1(out["depth"], depth, mask),
            "depth_level": w.depth_level * losses.mean(level, mask),
            "depth_gradient": w.depth_gradient * gradient("depth", depth),
            "slopes": w.slopes * losses.slopes(out["depth"], batch["rays"], batch["normal"], mask),
            "mask": w.mask * nn.functional.binary_cross_entropy_with_logits(out["mask"], mask),
        }

    def predict(self, network: nn.Module, sample: Sample) -> Prediction:
        assert isinstance(network, BundledNetwork)
        with torch.inference_mode():
            return infer_bundled(
                network, sample.image, sample.rays, device=next(network.parameters()).device
            )


def relative_log_depth(depth: Tensor, mask: Tensor) -> Tensor:
    """Natural logarithm of depth [B, 1, H, W] over each picture's median, limited to [-3, 3]; 0 off the mask."""
    logarithm = depth.clamp(min=1e-4).log()
    hidden = torch.where(mask > 0, logarithm, torch.nan)
    median = hidden.flatten(1).nanmedian(1).values.nan_to_num().view(-1, 1, 1, 1)
    return ((logarithm - median).clamp(-3, 3)) * mask
