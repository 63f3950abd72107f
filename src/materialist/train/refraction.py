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
from materialist.procedural.thickness.dataset import load
from materialist.procedural.thickness.errors import mean_errors
from materialist.train.task import Batch, Examples, Recipe, Task
from materialist.types import Array

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


class ViewExamples(Examples):
    """Views of shapes in memory; `draw` mirrors and recolours them."""

    def __init__(self, views: dict[str, Array]):
        self.views = views
        self._at = {views["maps"].shape[-1]: views}

    def __len__(self) -> int:
        return len(self.views["maps"])

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """maps [C, S, S], target [5, S, S] and hollow [] of one view; S is `side`."""
        if side not in self._at:
            self._at[side] = smaller(self.views, side)
        views = self._at[side]
        maps, target = views["maps"][index].astype(np.float32), views["target"][index].astype(np.float32)
        if rng.random() < 0.5:
            maps, target = maps[..., ::-1].copy(), target[..., ::-1].copy()
            maps[NORMAL_X] *= -1
            target[BACK_X] *= -1
        gain, order = rng.uniform(0.7, 1.2, (3, 1, 1)), rng.permutation(3)
        inside = maps[MASK]
        maps[:3] = (np.clip((maps[:3] + 0.5 * inside)[order] * gain, 0, 1) - 0.5) * inside
        return {"maps": maps, "target": target, "hollow": np.float32(views["hollow"][index])}


class RefractionTask(Task):
    """The network that predicts how thick an object is, and the normals of its back."""

    kind: ClassVar[str] = "refraction"

    def __init__(self, views: Path, held_out: Path | None, recipe: Recipe = RECIPE, *, init: Path | None = None):
        """Views to learn from, views that are only scored, and weights to begin from.

        Raises InputError for a folder without views, or pictures larger than SIDE.
        """
        if recipe.side > SIDE:
            raise InputError(f"The size of training pictures is {recipe.side}; views have {SIDE} pixels.")
        super().__init__(ViewExamples(load(views)), recipe, init)
        self.held_out = None if held_out is None else load(held_out)

    def make(self) -> RefractionNet:
        """RefractionNet, which begins as the symmetry prior."""
        return RefractionNet()

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Errors of lengths and of their logarithms, and of the normals of the back; see `ThicknessLoss`."""
        found, target, weight = network(batch["maps"]).float(), batch["target"], ThicknessLoss()
        inside = batch["maps"][:, MASK] * (target[:, 0] > 0)
        count = inside.sum((1, 2)).clamp(min=1)
        terms = {}
        for k, (name, share) in enumerate((("solid", 1.0), ("hollow", weight.hollow))):
            a, b, soft = found[:, k], target[:, k], weight.soft[k]
            mean = (b * inside).sum((1, 2)) / count
            length = ((a - b).abs() * inside).sum((1, 2)) / count / (mean + 2 * soft)
            ratio = ((a + soft).log() - (b + soft).log()).abs()
            each = length + weight.logarithm * (ratio * inside).sum((1, 2)) / count
            if k == 1:  # only hollow shapes have walls to learn from
                each = each * batch["hollow"] / batch["hollow"].mean().clamp(min=0.1)
            terms[name] = share * each.mean()
        # Means over the pixels of smaller views are shorter than 1 where the back is bent: they say less there.
        cosine = (found[:, BACK_X:] * target[:, BACK_X:]).sum(1)
        length = target[:, BACK_X:].square().sum(1).clamp(min=1e-8).sqrt()
        terms["back"] = weight.back * (((length - cosine) * inside).sum((1, 2)) / count).mean()
        return terms

    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Errors on the views kept aside; see `procedural.thickness.errors`."""
        return {} if self.held_out is None else mean_errors(copy.deepcopy(network).cpu(), self.held_out)


def smaller(views: dict[str, Array], side: int, at_a_time: int = 256) -> dict[str, Array]:
    """Views at side x side pixels: means over what is known; a pixel is inside where half of it is."""
    count = len(views["maps"])
    result = {name: np.empty((*views[name].shape[:2], side, side), np.float16) for name in ("maps", "target")}
    shrink = lambda x: F.interpolate(torch.from_numpy(x), (side, side), mode="area").numpy()  # noqa: E731
    for k in range(0, count, at_a_time):
        part = slice(k, k + at_a_time)
        maps, target = views["maps"][part].astype(np.float32), views["target"][part].astype(np.float32)
        for name, values, weight in (
            ("maps", maps, maps[:, MASK : MASK + 1]), ("target", target, (target[:, :1] > 0).astype(np.float32))
        ):  # fmt: skip
            share = shrink(np.ascontiguousarray(weight))
            result[name][part] = np.where(share > 0.5, shrink(values) / np.maximum(share, 1e-6), 0)
    return {**result, "hollow": views["hollow"]}
