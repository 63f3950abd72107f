"""ClickNet, trained on procedural pictures as the bundled network sees them."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional as F

from materialist.errors import InputError
from materialist.predict.clicks.network import ClickNet
from materialist.predict.network import UNetArchitecture
from materialist.train.click_views import ClickView, draw_click, load
from materialist.train.task import Batch, Examples, Recipe, Task
from materialist.types import Array

RECIPE = Recipe(side=224, batch=16, rate=1.5e-3, growth=((0.5, 128),))
HELD_OUT = 48
"""Views, the last ones, that are only scored, where there are ten times as many."""
CLICKS = 3
"""Clicks on each held-out view."""
DRAWS = 100
"""Views tried for one with something to click on."""


class ClickExamples(Examples):
    """Random parts of views with a click in them."""

    def __init__(self, views: list[ClickView]):
        self.views = views

    def __len__(self) -> int:
        return len(self.views)

    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """maps [C, side, side] and mask [side, side] of a click in that view, or in another one if it shows nothing."""
        for _ in range(DRAWS):
            if (found := draw_click(self.views[index], side, rng)) is not None:
                return {"maps": found[0], "mask": found[1].astype(np.float32)}
            index = int(rng.integers(len(self.views)))
        raise InputError("The views show nothing to click on; make them of a larger data set.")


class ClickTask(Task):
    """The network that finds the object at a click."""

    kind: ClassVar[str] = "clicks"

    def __init__(
        self, views: Path, recipe: Recipe = RECIPE, *, init: Path | None = None,
        architecture: UNetArchitecture | None = None,
    ):  # fmt: skip
        """Views to learn from and weights to begin from. Raises InputError for a folder without views."""
        found = load(views)
        if not found:
            raise InputError(f"{views} holds no views to learn from.")
        aside = HELD_OUT if len(found) >= 10 * HELD_OUT else 0
        super().__init__(ClickExamples(found[: len(found) - aside]), recipe, init)
        self.held_out, self.architecture = found[len(found) - aside :], architecture

    def make(self) -> ClickNet:
        """ClickNet."""
        return ClickNet(self.architecture)

    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Cross-entropy, and one minus the soft overlap (Dice), of logits with masks [B, S, S]."""
        return click_losses(network(batch["maps"]).float(), batch["mask"])

    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Mean and median intersection over union of one click, on the views kept aside."""
        network, overlap = copy.deepcopy(network).cpu(), []
        for number, view in enumerate(self.held_out):
            rng = np.random.default_rng([7, number])
            for maps, mask in filter(None, (draw_click(view, self.recipe.side, rng) for _ in range(CLICKS))):
                with torch.inference_mode():
                    found = network(torch.from_numpy(maps)[None])[0].numpy() > 0
                overlap.append((found & mask).sum() / (found | mask).sum())
        return {"iou": float(np.mean(overlap)), "iou_median": float(np.median(overlap))} if overlap else {}


def click_losses(found: Tensor, mask: Tensor) -> dict[str, Tensor]:
    """Cross-entropy, and one minus the soft overlap, of logits [B, S, S] with masks [B, S, S]."""
    share = found.sigmoid()
    both = 2 * (share * mask).sum((1, 2)) + 1
    return {
        "entropy": F.binary_cross_entropy_with_logits(found, mask),
        "overlap": (1 - both / (share.sum((1, 2)) + mask.sum((1, 2)) + 1)).mean(),
    }
