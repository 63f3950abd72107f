"""What a run trains: a network, the examples that it learns from, its losses and its scores."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from materialist.errors import InputError
from materialist.predict.network import StoredNetwork, shared_tensors
from materialist.predict.weights import load_weights, read_state
from materialist.types import Array

Batch = Mapping[str, Tensor]
"""Names of an example's arrays -> [B, ...]."""

MULTIPLE = 32
"""Sides of training pictures are multiples of this: the networks halve them five times."""


@dataclass(frozen=True)
class Recipe:
    """Settings of the optimiser (AdamW) and of the size of training pictures; stored with the weights."""

    side: int
    """Pixels on a side of training pictures, at the end where `growth` has smaller ones before."""
    batch: int
    """Pictures a step."""
    rate: float
    """Peak learning rate."""
    weight_decay: float = 0.02  # of weights, not of biases and gains; tuned by eye
    betas: tuple[float, float] = (0.9, 0.98)  # of AdamW; tuned by eye
    warm_up: int = 100  # steps in which the rate rises to its peak; tuned by eye
    # rate at the end of the cosine, as a part of the peak; 1 keeps it constant
    last_rate: float = 0.01
    ema: float = 0.998  # decay a step of the averaged weights; 0 averages nothing; tuned by eye
    clip: float = 1.0  # largest norm of the gradient; tuned by eye
    bfloat16: bool | None = None
    """Whether convolutions and products run in bfloat16; None where the device is faster with it."""
    growth: tuple[tuple[float, int], ...] = ()
    """(part of the run, side of the pictures up to there), in order: several small pictures cost one large one."""

    def __post_init__(self) -> None:
        for side in (self.side, *(size for _, size in self.growth)):
            if side < MULTIPLE or side % MULTIPLE:
                raise InputError(
                    f"The size of training pictures is {side}; give a multiple of {MULTIPLE}."
                )
        if self.batch < 1:
            raise InputError(f"The batch is {self.batch}; give at least 1.")
        if not 0 < self.rate < 1:
            raise InputError(f"The learning rate is {self.rate:g}; give a number between 0 and 1.")

    def side_at(self, progress: float) -> int:
        """Side of the pictures when `progress` of the run, in [0, 1], is done."""
        return next((side for end, side in self.growth if progress < end), self.side)

    def uses_bfloat16(self, device: torch.device) -> bool:
        """Whether a run on `device` computes in bfloat16."""
        return has_bfloat16(device) if self.bfloat16 is None else self.bfloat16

    def changed(self, **changes: Any) -> Recipe:
        """The recipe with those changes that are not None; a given `side` holds for the whole run."""
        kept = {k: v for k, v in changes.items() if v is not None}
        return replace(self, **(({"growth": ()} if "side" in kept else {}) | kept))


def has_bfloat16(device: torch.device) -> bool:
    """Whether a device has instructions for bfloat16. Without them it is emulated, ten times slower than float32."""
    if device.type == "cuda":
        return torch.cuda.is_bf16_supported()
    try:
        flags = Path("/proc/cpuinfo").read_text("utf-8", errors="replace")
    except OSError:
        return False
    return "avx512_bf16" in flags or "amx_bf16" in flags


class Task(ABC):
    """One of the networks, and everything that its training needs."""

    kind: ClassVar[str]
    """What checkpoints call its runs: the name of the command."""
    notes: tuple[str, ...] = ()
    """What the log must say at the start."""
    new_parts: ClassVar[tuple[str, ...]] = ()
    """Prefixes of the tensors that weights of earlier versions lack."""

    def __init__(self, recipe: Recipe, init: Path | None = None):
        """`init`: weights to begin from."""
        self.recipe = recipe
        self.init = init

    @abstractmethod
    def count(self) -> int:
        """How many examples there are at present."""

    @abstractmethod
    def draw(self, index: int, side: int, rng: np.random.Generator) -> dict[str, Array]:
        """A random variant of example `index`, at side x side pixels unless `vary` sees to that.

        Raises InputError when it is damaged.
        """

    def vary(self, batch: Batch, side: int, random: torch.Generator) -> Batch:
        """The batch with what is changed at random in all its examples together, where the network is trained."""
        return batch

    def refresh(self) -> None:  # noqa: B027 (examples in memory do not change)
        """Look again: a set on disk may grow while it is used."""

    @abstractmethod
    def make(self) -> StoredNetwork:
        """A new network; parameters that do not learn have requires_grad False."""

    @abstractmethod
    def losses(self, network: nn.Module, batch: Batch) -> dict[str, Tensor]:
        """Weighted terms of the loss by name; their sum is minimised."""

    @abstractmethod
    def scores(self, network: nn.Module, folder: Path) -> dict[str, Any]:
        """Figures of a network in evaluation mode on examples that are kept aside; may draw pictures into FOLDER."""

    def network(self) -> StoredNetwork:
        """A network to begin from: that of `init`, with new parts where it lacks those of `new_parts`.

        Raises WeightsError for weights that are damaged or of another architecture.
        """
        network = self.make()
        if self.init is not None:
            untrained = network.state_dict()
            new = {k: v for k, v in untrained.items() if k.startswith(self.new_parts)}
            stored = read_state(self.init) | shared_tensors(network)
            load_weights(network, new | stored, self.init)
        return network

    def data(self) -> dict[str, Any]:
        """Plain values about the data, stored with the weights."""
        return {"views": self.count()}
