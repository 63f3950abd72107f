"""The training of RefractionNet; how a run is kept is in `train.small`."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.errors import InputError
from materialist.predict.refraction.crop import BACK_X, MASK, NORMAL_X, SIDE
from materialist.predict.refraction.network import STRIDE, RefractionNet
from materialist.procedural.thickness import dataset as lessons
from materialist.procedural.thickness.errors import score
from materialist.train import small
from materialist.train.budget import Budget
from materialist.types import Array

SOFT = (0.05, 0.02)
"""Added to solid and hollow thickness before logarithms: what is thinner counts little."""


@dataclass(frozen=True)
class Recipe(small.Recipe):
    """Everything that decides how the network is trained; stored with its weights."""

    hollow: float = 0.4
    """Weight of the hollow thickness in the loss."""
    logarithm: float = 0.3
    """Weight of the difference of logarithms beside that of the lengths."""
    back: float = 1.0
    """Weight of the normals of the back: one minus the cosine of their error."""
    side: int = 32
    """Pixels on a side of the views at first: smaller ones train faster, and most can be learnt on them."""
    full_size: float = 0.6
    """Part of the run after which views have their full SIDE."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.side < STRIDE or self.side > SIDE or self.side % STRIDE:
            raise InputError(f"The side is {self.side} pixels; give a multiple of {STRIDE} up to {SIDE}.")


class Trainer(small.Run):
    """One run in one folder."""

    kind = "refraction"
    recipe: Recipe

    def __init__(
        self, folder: Path, data: Path, heldout: Path | None, *, budget: Budget, recipe: Recipe | None = None,
        seed: int = 0, every: float = 180, resume: bool = False, note: Callable[[str], None] = lambda _: None,
        device: str = "auto", init: Path | None = None,
    ):  # fmt: skip
        """Start or resume a run. `init`: weights that a new one begins with, as the package reads them.

        Raises OutputError when FOLDER holds a run and `resume` is off, WeightsError for weights of another network.
        """
        self.data = data
        self.kept_aside = None if heldout is None else lessons.load(heldout)

        def network() -> RefractionNet:
            return RefractionNet() if init is None else RefractionNet.load(init)[0].train().requires_grad_(True)

        super().__init__(
            folder, network, recipe or Recipe(), budget=budget, seed=seed, every=every, resume=resume, note=note,
            device=device,
        )  # fmt: skip

    def figures(self) -> dict[str, float]:
        """Scores on the shapes kept aside."""
        return {} if self.kept_aside is None else score(self.averaged, self.kept_aside)

    def write(self, path: Path, facts: dict[str, Any]) -> None:
        """The averaged weights as the package reads them."""
        self.averaged.save(path, facts)

    def terms(self, found: Tensor, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """See `losses`."""
        return losses(found, batch, self.recipe)

    def batches(self) -> Iterator[dict[str, Tensor]]:
        """Epoch after epoch over the views that are there, in random order, every other one mirrored."""
        known, side, views = -1, 0, {}
        while True:
            wanted = SIDE if self.clock.progress >= self.recipe.full_size else self.recipe.side
            if (lessons.count(self.data), wanted) != (known, side):  # a set that is still being made grows
                known, side = lessons.count(self.data), wanted
                views = smaller(lessons.load(self.data), side)
            self.epoch += 1
            rng = np.random.default_rng([self.seed, self.epoch])
            order, size = rng.permutation(len(views["maps"])), self.recipe.batch
            if len(order) < size:
                order = np.resize(order, size)
            for k in range(0, len(order) - size + 1, size):
                yield prepared(views, order[k : k + size], rng)


def prepared(views: dict[str, Array], chosen: Array, rng: np.random.Generator) -> dict[str, Tensor]:
    """A batch: maps [B, C, S, S] and target [B, 5, S, S] float32, hollow [B]; mirrored and recoloured at random."""
    maps, target = views["maps"][chosen].astype(np.float32), views["target"][chosen].astype(np.float32)
    flip = rng.random(len(chosen)) < 0.5
    maps[flip], target[flip] = maps[flip, ..., ::-1], target[flip, ..., ::-1]
    maps[flip, NORMAL_X] *= -1
    target[flip, BACK_X] *= -1
    gain, order = rng.uniform(0.7, 1.2, (len(chosen), 3, 1, 1)), rng.permutation(3)
    inside = maps[:, MASK : MASK + 1]
    maps[:, :3] = (np.clip((maps[:, :3] + 0.5 * inside)[:, order] * gain, 0, 1) - 0.5) * inside
    hollow = torch.from_numpy(views["hollow"][chosen].astype(np.float32))
    return {"maps": torch.from_numpy(maps), "target": torch.from_numpy(target), "hollow": hollow}


def smaller(views: dict[str, Array], side: int, at_a_time: int = 256) -> dict[str, Array]:
    """Views at side x side pixels: means over what is known; a pixel is inside where half of it is."""
    if side == views["maps"].shape[-1]:
        return views
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


def losses(found: Tensor, batch: dict[str, Tensor], recipe: Recipe) -> dict[str, Tensor]:
    """The terms of the loss of predictions [B, 5, S, S]: relative length and logarithm, solid and hollow; the back."""
    target, maps = batch["target"], batch["maps"]
    inside = maps[:, MASK] * (target[:, 0] > 0)
    count = inside.sum((1, 2)).clamp(min=1)
    terms = {}
    for k, (name, share) in enumerate((("solid", 1.0), ("hollow", recipe.hollow))):
        a, b = found[:, k], target[:, k]
        mean = (b * inside).sum((1, 2)) / count
        length = ((a - b).abs() * inside).sum((1, 2)) / count / (mean + 2 * SOFT[k])
        ratio = ((a + SOFT[k]).log() - (b + SOFT[k]).log()).abs()
        each = length + recipe.logarithm * (ratio * inside).sum((1, 2)) / count
        if k == 1:  # only hollow shapes have walls to learn from
            each = each * batch["hollow"] / batch["hollow"].mean().clamp(min=0.1)
        terms[name] = share * each.mean()
    # Means over pixels of smaller views are shorter than 1 where the back is bent: they say less there.
    cosine = (found[:, BACK_X:] * target[:, BACK_X:]).sum(1)
    length = target[:, BACK_X:].square().sum(1).clamp(min=1e-8).sqrt()
    terms["back"] = recipe.back * (((length - cosine) * inside).sum((1, 2)) / count).mean()
    return terms
