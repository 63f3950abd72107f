"""RefractionNet, trained on views of procedural shapes with the thickness that camera rays find in them."""

import copy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.errors import InputError
from materialist.predict.refraction.crop import BACK_X, MASK, NORMAL_X, SIDE
from materialist.predict.refraction.network import RefractionNet
from materialist.types import Array
from materialist_lab.procedural.thickness.dataset import load_views
from materialist_lab.procedural.thickness.errors import mean_errors
from materialist_lab.train.task import Batch, Recipe, Task

RECIPE = Recipe(side=SIDE, batch=32, rate=2e-3, growth=((0.6, 32),))
"""Small views train faster, and most can be learnt on them."""


@dataclass(frozen=True)
class ThicknessLoss:
    """Weights of the loss, tuned by eye; that of the solid thickness is 1."""

    hollow: float = 0.4  # of the hollow thickness
    logarithm: float = 0.3  # of the difference of logarithms beside that of the lengths
    back: float = 1.0  # of one minus the cosine between the normals of the back
    soft: tuple[float, float] = (0.05, 0.02)
    """Added to solid and hollow thickness before logarithms, in object sizes: thinner parts count little."""


class RefractionTask(Task):
    """The network that predicts how thick an object is, and the normals of its back."""

    kind: ClassVar[str] = "refraction"

    def __init__(
        self,
        views: Path,
        held_out: Path | None,
        recipe: Recipe = RECIPE,
        *,
        init: Path | None = None,
    ):
        """Views to learn from, views that are only scored, and weights to begin from.

        Raises InputError for a folder without views, or pictures larger than SIDE.
        """
        if recipe.side > SIDE:
            raise InputError(
                f"The size of training pictures is {recipe.side}; views have {SIDE} pixels."
            )
        super().__init__(recipe, init)
        self.views = load_views(views)
        self.held_out = None if held_out is None else load_views(held_out)

    def count(self) -> int:
        return len(self.views["maps"])

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """maps [C, S, S], target [5, S, S] and hollow [] of one view as it is; `vary` changes it."""
        return {name: values[index] for name, values in self.views.items()}

    def vary(self, batch: Batch, side: int, random: torch.Generator) -> Batch:
        """The views at side x side pixels, half of them mirrored, all in other colours."""
        maps = batch["maps"].float()
        target = batch["target"].float()
        if side < SIDE:
            maps = smaller(maps, maps[:, MASK, None], side)
            target = smaller(target, (target[:, :1] > 0).float(), side)

        def rand(*shape):
            return torch.rand(*shape, generator=random, device=maps.device)

        turned = rand(len(maps), 1, 1, 1) < 0.5
        maps = mirrored(maps, NORMAL_X, turned)
        target = mirrored(target, BACK_X, turned)
        order = rand(len(maps), 3).argsort(1)[..., None, None]
        gain = 0.7 + 0.5 * rand(len(maps), 3, 1, 1)
        inside = maps[:, MASK, None]
        colours = (maps[:, :3] + 0.5 * inside).take_along_dim(order, 1)
        colours = ((colours * gain).clamp(0, 1) - 0.5) * inside
        return {
            "maps": torch.cat([colours, maps[:, 3:]], 1),
            "target": target,
            "hollow": batch["hollow"].float(),
        }

    def make(self) -> RefractionNet:
        """RefractionNet, which begins as the symmetry prior."""
        return RefractionNet()

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Errors of lengths and of their logarithms, and of the normals of the back; see `ThicknessLoss`."""
        predicted = network(batch["maps"]).float()
        target = batch["target"]
        weight = ThicknessLoss()
        # Where the predicted mask and the truth agree that there is the object.
        inside = batch["maps"][:, MASK] * (target[:, 0] > 0)
        count = inside.sum((1, 2)).clamp(min=1)
        terms = {}
        for k, (name, share) in enumerate((("solid", 1.0), ("hollow", weight.hollow))):
            # Absolute errors relative to the mean, and errors of logarithms, which thin parts need.
            a = predicted[:, k]
            b = target[:, k]
            soft = weight.soft[k]
            mean = (b * inside).sum((1, 2)) / count
            length = ((a - b).abs() * inside).sum((1, 2)) / count / (mean + 2 * soft)
            ratio = ((a + soft).log() - (b + soft).log()).abs()
            each = length + weight.logarithm * (ratio * inside).sum((1, 2)) / count
            if k == 1:  # only hollow shapes have walls to learn from
                each = each * batch["hollow"] / batch["hollow"].mean().clamp(min=0.1)
            terms[name] = share * each.mean()
        # Means over the pixels of smaller views are shorter than 1 where the back is bent: they say less there.
        cosine = (predicted[:, BACK_X:] * target[:, BACK_X:]).sum(1)
        length = target[:, BACK_X:].square().sum(1).clamp(min=1e-8).sqrt()
        terms["back"] = weight.back * (((length - cosine) * inside).sum((1, 2)) / count).mean()
        return terms

    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Errors on the views kept aside; see `procedural.thickness.errors`."""
        return (
            {}
            if self.held_out is None
            else mean_errors(copy.deepcopy(network).cpu(), self.held_out)
        )


def smaller(values: Tensor, known: Tensor, side: int) -> Tensor:
    """Maps [B, C, S, S] at side x side pixels: means over what is known [B, 1, S, S]; 0 where half of it is not."""
    share, total = (F.interpolate(map_, (side, side), mode="area") for map_ in (known, values))
    return torch.where(share > 0.5, total / share.clamp(min=1e-6), 0)


def mirrored(values: Tensor, x: int, chosen: Tensor) -> Tensor:
    """Maps [B, C, S, S] turned around where chosen [B, 1, 1, 1]; channel `x` is that of normals."""
    turned = values.flip(-1)
    turned[:, x] *= -1
    return torch.where(chosen, turned, values)
