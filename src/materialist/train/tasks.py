"""What is trained: for each recipe its network, its augmentation, its losses, and how its answers are read."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from materialist.io.samples import Sample
from materialist.predict.bundled.inference import infer
from materialist.predict.bundled.network import BundledArchitecture, BundledNetwork, srgb
from materialist.procedural.photographic import as_photo
from materialist.train import losses, start
from materialist.train.augment import augment
from materialist.train.recipes import Recipe
from materialist.types import Prediction

Batch = Mapping[str, Tensor]
"""Names of `tensors` -> [B, C, H, W] float32."""


class Task(Protocol):
    """A network to train and what it learns."""

    notes: tuple[str, ...]
    """What the log must say about this task: substitutes and the like."""

    def network(self, recipe: Recipe) -> nn.Module:
        """A fresh network; parameters that do not learn have requires_grad False."""
        ...

    def prepare(self, sample: Sample, size: int, rng: np.random.Generator) -> Sample:
        """A random variant of a sample, as a photograph."""
        ...

    def terms(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Weighted terms of the loss, by name; their sum is minimised."""
        ...

    def predict(self, network: nn.Module, sample: Sample) -> Prediction:
        """The maps of a sample that is a photograph already."""
        ...


def tensors(sample: Sample) -> dict[str, Tensor]:
    """The sample as [C, H, W] tensors: image, rays, albedo (linear), roughness, metallic, normal, depth, mask."""
    arrays = {name: getattr(sample, name) for name in sample.__dataclass_fields__ if name != "shading"}
    return {
        name: torch.from_numpy(np.ascontiguousarray(np.moveaxis(a, -1, 0) if a.ndim == 3 else a[None], np.float32))
        for name, a in arrays.items()
    }


class BundledTask:
    """The bundled network, on procedural pictures."""

    notes: tuple[str, ...] = (
        "Albedo is compared by L1, L2, gradients at four scales, and after one factor a picture; there is no LPIPS: "
        "its backbone is not part of this project.",
    )

    def __init__(self, init: Path | None = None):
        """`init`: exported weights to begin from, of a network with or without an encoder."""
        self.init = init

    def network(self, recipe: Recipe) -> nn.Module:
        """A network of the recipe's architecture, to begin from."""
        network = BundledNetwork(BundledArchitecture.from_dict(recipe.network))
        if self.init is not None:
            start.fill(network, self.init)
        return network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def prepare(self, sample: Sample, size: int, rng: np.random.Generator) -> Sample:
        """Crop, flip, recolour, expose, photograph."""
        return as_photo(augment(sample, size, rng), rng)

    def terms(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Losses of all maps. L2 stands beside L1 because the mean, not the median, is the better prior in doubt."""
        image = batch["image"].contiguous(memory_format=torch.channels_last)
        out, mask = network(image, batch["rays"]), batch["mask"]
        albedo = srgb(batch["albedo"])
        found = {
            "albedo": losses.l1(out["albedo"], albedo, mask) + 2 * losses.l2(out["albedo"], albedo, mask),
            "albedo_scaled": 2 * losses.scaled_l1(out["albedo"] ** 2.2, albedo**2.2, mask),
            "albedo_gradient": 0.7 * losses.gradient(out["albedo"], albedo, mask),
        }
        roughness, metallic = batch["roughness"], batch["metallic"]
        found["roughness"] = 0.1 * losses.l1(out["roughness"], roughness, mask)
        found["roughness"] += 3 * losses.l2(out["roughness"], roughness, mask)
        found["roughness"] += 0.2 * losses.gradient(out["roughness"], roughness, mask)
        # Metal is rare: under L1 and L2 a sigmoid ends at 0 everywhere, where it has no gradient left.
        found["metallic"] = losses.cross_entropy(out["metallic_logit"], metallic, mask)
        found["metallic"] += 0.2 * losses.gradient(out["metallic"], metallic, mask)
        found["normal"] = 1.5 * losses.cosine(out["normal"], batch["normal"], mask)
        found["normal_gradient"] = 0.2 * losses.gradient(out["normal"], batch["normal"], mask)
        return found | self._geometry(out, batch, mask)

    def _geometry(self, out: Batch, batch: Batch, mask: Tensor) -> dict[str, Tensor]:
        """Losses of depth and of where there is a surface."""
        true = relative_log_depth(batch["depth"], mask)
        return {
            "depth": 1.5 * losses.centred_l1(out["depth"], true, mask),
            "depth_level": 0.1 * losses.mean((out["depth"] - true).abs().clamp(max=2), mask),
            "depth_gradient": 1.5 * losses.gradient(out["depth"], true, mask),
            "slopes": 0.5 * losses.slopes(out["depth"], batch["rays"], batch["normal"], mask),
            "mask": 0.2 * nn.functional.binary_cross_entropy_with_logits(out["mask"], mask),
        }

    def predict(self, network: nn.Module, sample: Sample) -> Prediction:
        """As the predictor does it."""
        assert isinstance(network, BundledNetwork)
        return infer(network, sample.image, sample.rays, device=next(network.parameters()).device)


def relative_log_depth(depth: Tensor, mask: Tensor) -> Tensor:
    """Natural logarithm of depth [B, 1, H, W] over each picture's median, limited to [-3, 3]; 0 off the mask."""
    logarithm = depth.clamp(min=1e-4).log()
    hidden = torch.where(mask > 0, logarithm, torch.nan)
    median = hidden.flatten(1).nanmedian(1).values.nan_to_num().view(-1, 1, 1, 1)
    return ((logarithm - median).clamp(-3, 3)) * mask


def task(recipe: Recipe, options: dict[str, Any] | None = None) -> Task:
    """The task of a recipe; `options` are those of the task (initial weights of the paper's network)."""
    if recipe.task == "paper":
        from materialist.train.paper_task import PaperTask

        return PaperTask(**(options or {}))
    return BundledTask(**(options or {}))


__all__ = ["Batch", "BundledTask", "Task", "relative_log_depth", "task", "tensors"]
