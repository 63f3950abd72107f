"""How long a run lasts, and the learning rate that follows from it."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

from materialist.errors import InputError

WARM_AGAIN = 100
"""Steps in which the rate rises again after a resumption: Adam's averages are of another rate."""


@dataclass(frozen=True)
class Budget:
    """Steps or minutes of this start, on top of what earlier ones did."""

    steps: int | None = None
    minutes: float | None = None

    def __post_init__(self) -> None:
        if (self.steps is None) == (self.minutes is None):
            raise InputError("Say how long to train with either --steps or --minutes.")
        if (self.steps or self.minutes or 0) <= 0:
            raise InputError(f"The budget is {self.steps or self.minutes}; give more than 0.")


class Clock:
    """Where a run stands within its budget, counted over all its starts."""

    def __init__(self, budget: Budget, *, step: int = 0, seconds: float = 0.0):
        self.budget = budget
        self.first_step, self.step = step, step
        self._earlier = seconds
        self._start = time.monotonic()

    @property
    def seconds(self) -> float:
        """Seconds trained in all starts together."""
        return self._earlier + time.monotonic() - self._start

    @property
    def progress(self) -> float:
        """Part of the whole that is done, in [0, 1]: all starts so far and the budget of this one."""
        if self.budget.steps is not None:
            return min(1.0, self.step / (self.first_step + self.budget.steps))
        return min(1.0, self.seconds / (self._earlier + 60 * (self.budget.minutes or 0)))

    @property
    def done(self) -> bool:
        """Whether the budget of this start is spent."""
        return self.progress >= 1

    def rate(self, warm_up: int, last: float) -> float:
        """Factor on the peak learning rate: a rise, then half a cosine down to `last` at the end of the budget.

        A resumed run follows the cosine of its new, longer whole: a short budget at the end anneals, a long one goes
        on learning.
        """
        steps = warm_up if self.first_step == 0 else min(warm_up, WARM_AGAIN)
        rise = min(1.0, (self.step - self.first_step + 1) / steps) if steps else 1.0
        return rise * (last + (1 - last) * 0.5 * (1 + math.cos(math.pi * self.progress)))
