"""The one optimisation loop: Adam, a step-wise falling learning rate, early stopping, progress."""

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
import torch

from materialist.fit.settings import Schedule
from materialist.types import Progress

Stop = Callable[[], bool]
"""Asked after each step; True ends the fit with what it has."""


def never() -> bool:
    """No reason to stop."""
    return False


@dataclass(frozen=True)
class StageResult:
    """What one stage did."""

    name: str
    steps: int
    seconds: float
    losses: tuple[float, ...] = field(repr=False)

    def summary(self) -> dict:
        """Entry of report.json: steps, seconds, and the losses at up to 50 steps."""
        stride = max(1, -(-len(self.losses) // 50))
        return {
            "name": self.name,
            "steps": self.steps,
            "seconds": round(self.seconds, 3),
            "loss_first": self.losses[0] if self.losses else None,
            "loss_last": self.losses[-1] if self.losses else None,
            "loss_curve": [round(v, 6) for v in self.losses[::stride]],
        }


class Adam:
    """Adam (Kingma and Ba 2015), step for step `torch.optim.Adam`, which first imports a compiler for seconds."""

    BETAS = (0.9, 0.999)
    EPSILON = 1e-8

    def __init__(self, tensors: list[torch.Tensor]):
        self.tensors = tensors
        self.steps = 0
        self.means, self.squares = ([torch.zeros_like(t) for t in tensors] for _ in range(2))

    @torch.no_grad()
    def step(self, rate: float) -> None:
        """Move the tensors along their gradients, and forget those."""
        self.steps += 1
        first, second = self.BETAS
        # Bias corrections of both moments, once for all tensors.
        rate = rate / (1 - first**self.steps)
        root = math.sqrt(1 - second**self.steps)
        for tensor, mean, square in zip(self.tensors, self.means, self.squares, strict=True):
            if tensor.grad is None:
                continue
            mean.lerp_(tensor.grad, 1 - first)
            square.mul_(second).addcmul_(tensor.grad, tensor.grad, value=1 - second)
            tensor.addcdiv_(mean, (square.sqrt() / root).add_(self.EPSILON), value=-rate)
            tensor.grad = None


def optimise(
    name: str,
    parameters: Iterable[torch.Tensor],
    loss: Callable[[int], torch.Tensor],
    schedule: Schedule,
    *,
    after_step: Callable[[], None] | None = None,
    progress: Progress | None = None,
    stop: Stop = never,
) -> StageResult:
    """Minimise `loss(step)` over the tensors `parameters` in place.

    It stops when the best loss of the last `patience` steps is not `min_improvement` below the best before them.
    """
    if progress is not None:
        progress(name, 0, schedule.max_steps)  # a step may take a minute
    tensors = list(parameters)
    adam = Adam(tensors)
    best = float("inf")
    kept = [t.detach().clone() for t in tensors] if schedule.keep_best else []
    start = time.perf_counter()
    losses = []
    for step in range(schedule.max_steps):
        current = loss(step)
        current.backward()
        value = current.item()
        # The loss is that of the parameters before this step: those are kept.
        if schedule.keep_best and value < best:
            best = value
            kept = [t.detach().clone() for t in tensors]
        adam.step(schedule.rate(step))
        # Back into the allowed range, without a gradient.
        if after_step is not None:
            with torch.no_grad():
                after_step()
        losses.append(value)
        if progress is not None:
            progress(name, step + 1, schedule.max_steps)
        if stop() or _stalled(losses, schedule):
            break
    with torch.no_grad():
        for tensor, values in zip(tensors, kept, strict=False):  # kept is empty unless asked for
            tensor.copy_(values)
    return StageResult(name, len(losses), time.perf_counter() - start, tuple(losses))


def _stalled(losses: list[float], schedule: Schedule) -> bool:
    """The stopping rule (paper, Implementation Details): whether `patience` steps improved the loss too little.

    With the paper's preset the light ends below 1 % in 100 steps, the materials below 0.5 % in 200. `--preset default`
    sets the patience to 0, which never ends early. Losses are averaged over `averaged` steps; every tenth step asks.
    """
    n = schedule.patience
    # A tenth step is soon enough for a rule about 100 or 200 of them.
    if n == 0 or len(losses) < n + schedule.averaged or len(losses) % 10:
        return False
    # Means over `averaged` steps: the least of the last n against the least before.
    window = np.full(schedule.averaged, 1 / schedule.averaged)
    means = np.convolve(losses, window, mode="valid")
    before = means[:-n].min()
    recent = means[-n:].min()
    return recent > before * (1 - schedule.min_improvement)
