"""The training of ClickNet; how a run is kept is in `train.small`."""

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
from materialist.predict.clicks.network import ClickNet
from materialist.predict.unet import STRIDE
from materialist.train import small
from materialist.train.budget import Budget
from materialist.train.clicks.views import lesson, load
from materialist.train.start import fill

ASIDE = 48
"""Views that are kept aside, the last ones, where there are ten times as many."""
CLICKS = 3
"""Clicks on each of them for the figures."""


@dataclass(frozen=True)
class Recipe(small.Recipe):
    """Everything that decides how the network is trained; stored with its weights."""

    batch: int = 16
    rate: float = 1.5e-3
    side: int = 128
    """Pixels on a side of the lessons at first."""
    last_side: int = 224
    """The same at the end."""
    larger: float = 0.5
    """Part of the run after which lessons have it."""
    overlap: float = 1.0
    """Weight of one minus the overlap (soft Dice) beside cross entropy."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for side in (self.side, self.last_side):
            if side < STRIDE or side % STRIDE:
                raise InputError(f"The side is {side} pixels; give a multiple of {STRIDE}.")


def _begun(init: Path | None) -> ClickNet:
    """A network with the weights in `init`, if given."""
    network = ClickNet()
    if init is not None:
        fill(network, init)
    return network


class Trainer(small.Run):
    """One run in one folder."""

    kind = "clicks"
    recipe: Recipe

    def __init__(
        self, folder: Path, views: Path, *, budget: Budget, recipe: Recipe | None = None, seed: int = 0,
        every: float = 180, resume: bool = False, init: Path | None = None,
        note: Callable[[str], None] = lambda _: None, device: str = "auto",
    ):  # fmt: skip
        """Start a run, from the weights in `init`, or resume one. Raises OutputError for a second start."""
        found = load(views)
        if not found:
            raise InputError(f"{views} holds no views to learn from.")
        aside = ASIDE if len(found) >= 10 * ASIDE else 0
        self.views, self.aside = found[: len(found) - aside], found[len(found) - aside :]
        super().__init__(
            folder, lambda: _begun(init), recipe or Recipe(), budget=budget, seed=seed, every=every, resume=resume,
            note=note, device=device,
        )  # fmt: skip

    def figures(self) -> dict[str, float]:
        """Mean and median intersection over union of one click, on views kept aside."""
        if not self.aside:
            return {}
        overlap = []
        for number, view in enumerate(self.aside):
            rng = np.random.default_rng([7, number])
            for one in filter(None, (lesson(view, self.recipe.last_side, rng) for _ in range(CLICKS))):
                with torch.inference_mode():
                    found = self.averaged(torch.from_numpy(one[0])[None])[0].numpy() > 0
                overlap.append((found & one[1]).sum() / (found | one[1]).sum())
        return {"iou": float(np.mean(overlap)), "iou_median": float(np.median(overlap))}

    def write(self, path: Path, facts: dict[str, Any]) -> None:
        """The averaged weights as the package reads them."""
        self.averaged.save(path, facts)

    def batches(self) -> Iterator[dict[str, Tensor]]:
        """Lessons of random views, without end."""
        while True:
            self.epoch += 1
            rng = np.random.default_rng([self.seed, self.epoch])
            side = self.recipe.last_side if self.clock.progress >= self.recipe.larger else self.recipe.side
            lessons: list[tuple] = []
            while len(lessons) < self.recipe.batch:
                if (one := lesson(self.views[rng.integers(len(self.views))], side, rng)) is not None:
                    lessons.append(one)
            maps, masks = (np.stack(parts) for parts in zip(*lessons, strict=True))
            yield {"maps": torch.from_numpy(maps), "mask": torch.from_numpy(masks.astype(np.float32))}

    def terms(self, found: Tensor, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """Cross entropy, and one minus the soft overlap of logits [B, S, S] with masks."""
        mask, share = batch["mask"], found.sigmoid()
        both = 2 * (share * mask).sum((1, 2)) + 1
        return {
            "entropy": F.binary_cross_entropy_with_logits(found, mask),
            "overlap": self.recipe.overlap * (1 - both / (share.sum((1, 2)) + mask.sum((1, 2)) + 1)).mean(),
        }
