"""Recipes: everything that decides how a network is trained, by name."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

from materialist.errors import InputError


@dataclass(frozen=True)
class Recipe:
    """What `materialist train matnet --config NAME` does; stored with every checkpoint."""

    name: str
    task: str
    """Which network and losses: 'bundled' or 'paper'."""
    size: int
    """Side of the training crops, pixels; at the end, where `growth` has smaller ones before."""
    batch: int
    """Pictures a step, on each device."""
    rate: float
    """Peak learning rate."""
    weight_decay: float
    warm_up: int
    """Steps in which the rate rises to its peak, at the start and after every resumption."""
    last_rate: float
    """Rate at the end of the cosine, as a part of the peak; 1 keeps the rate constant."""
    ema: float
    """Decay of the averaged weights a step; 0 takes the weights as they are."""
    clip: float
    """Largest norm of the gradient."""
    bfloat16: bool
    """Whether convolutions and products run in bfloat16."""
    network: dict[str, Any]
    """Options of the network's architecture."""
    betas: tuple[float, float] = (0.9, 0.999)
    growth: tuple[tuple[float, int], ...] = ()
    """(part of the run, side of the crops up to there), in order: small pictures first, of which several cost one."""

    def size_at(self, progress: float) -> int:
        """Side of the crops when `progress` of the run, in [0, 1], is done."""
        return next((size for end, size in self.growth if progress < end), self.size)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)


RECIPES = {
    "bundled": Recipe(
        name="bundled",
        task="bundled",
        size=256,
        batch=8,
        rate=1e-3,
        weight_decay=0.02,
        warm_up=300,
        last_rate=0.02,
        ema=0.999,
        clip=1.0,
        bfloat16=True,
        network={"encoder": "lite2"},
        betas=(0.9, 0.98),
        growth=((0.6, 128), (0.8, 192)),
    ),
    # Paper, Implementation Details: AdamW, learning rate 1e-5, 512 x 512 crops. What it leaves open (batch, decay of
    # weights and of the rate) is torch's default, or constant.
    "paper": Recipe(
        name="paper",
        task="paper",
        size=512,
        batch=8,
        rate=1e-5,
        weight_decay=0.01,
        warm_up=0,
        last_rate=1.0,
        ema=0.0,
        clip=1e9,
        bfloat16=False,
        network={},
    ),
}


def recipe(name: str, **changes: Any) -> Recipe:
    """The named recipe with the changes that are not None; raises InputError for an unknown name or a bad value."""
    if name not in RECIPES:
        raise InputError(f"There is no training recipe '{name}'; choose one of {', '.join(RECIPES)}.")
    given = {k: v for k, v in changes.items() if v is not None}
    changed = replace(RECIPES[name], **(({"growth": ()} if "size" in given else {}) | given))
    if changed.size < 32 or changed.size % 32:
        raise InputError(f"The size of training crops is {changed.size}; give a multiple of 32.")
    if changed.batch < 1:
        raise InputError(f"The batch is {changed.batch}; give at least 1 picture.")
    if not 0 < changed.rate < 1:
        raise InputError(f"The learning rate is {changed.rate:g}; give a number between 0 and 1.")
    return changed
