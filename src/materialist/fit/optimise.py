"""The one optimisation loop: Adam, a step-wise falling learning rate, early stopping, progress."""

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import torch

from materialist.fit.settings import Schedule
from materialist.types import Progress


@dataclass(frozen=True)
class StageResult:
    """What one stage did."""

    name: str
    steps: int
    seconds: float
    losses: tuple[float, ...] = field(repr=False)

    def summary(self) -> dict:
        """Entry of report.json: steps, seconds, and the losses at up to 50 steps."""
        stride = max(1, len(self.losses) // 50)
        return {
            "name": self.name,
            "steps": self.steps,
            "seconds": round(self.seconds, 3),
            "loss_first": self.losses[0] if self.losses else None,
            "loss_last": self.losses[-1] if self.losses else None,
            "loss_curve": [round(v, 6) for v in self.losses[::stride]],
        }


def optimise(
    name: str, parameters: Iterable[torch.Tensor], loss: Callable[[int], torch.Tensor], schedule: Schedule, *,
    after_step: Callable[[], None] | None = None, progress: Progress | None = None,
) -> StageResult:  # fmt: skip
    """Minimise `loss(step)` over the tensors `parameters` in place.

    The loss that counts for early stopping is the best of each window of `patience` steps.
    """
    tensors = list(parameters)
    optimiser = torch.optim.Adam(tensors, lr=schedule.learning_rate)
    scheduler = torch.optim.lr_scheduler.StepLR(optimiser, schedule.decay_every, schedule.decay)
    best, kept = float("inf"), [t.detach().clone() for t in tensors] if schedule.keep_best else []
    start, losses = time.perf_counter(), []
    for step in range(schedule.max_steps):
        optimiser.zero_grad(set_to_none=True)
        value = loss(step)
        value.backward()
        if schedule.keep_best and value.item() < best:
            best, kept = value.item(), [t.detach().clone() for t in tensors]
        optimiser.step()
        scheduler.step()
        if after_step is not None:
            with torch.no_grad():
                after_step()
        losses.append(value.item())
        if progress is not None:
            progress(name, step + 1, schedule.max_steps)
        if _stalled(losses, schedule):
            break
    with torch.no_grad():
        for tensor, value in zip(tensors, kept, strict=False):  # kept is empty unless asked for
            tensor.copy_(value)
    return StageResult(name, len(losses), time.perf_counter() - start, tuple(losses))


def _stalled(losses: list[float], schedule: Schedule) -> bool:
    n = schedule.patience
    if n == 0 or len(losses) <= n or len(losses) % 10:
        return False
    before, recent = min(losses[:-n]), min(losses[-n:])
    return recent > before * (1 - schedule.min_improvement)
