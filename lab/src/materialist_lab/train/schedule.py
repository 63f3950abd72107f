"""How long a run lasts, and the learning rate that follows from it."""

import math
import time
from dataclasses import dataclass
from typing import Any

from materialist.errors import InputError

WARM_UP_AGAIN = 100
"""Steps in which the rate rises again when a run gets another budget."""


@dataclass(frozen=True)
class Budget:
    """Steps or minutes to train, on top of what the run has done before."""

    steps: int | None = None
    minutes: float | None = None

    def __post_init__(self) -> None:
        if (self.steps is None) == (self.minutes is None):
            raise InputError("Say how long to train with either --steps or --minutes.")
        if (self.steps or self.minutes or 0) <= 0:
            raise InputError(f"The budget is {self.steps or self.minutes}; give more than 0.")


class TrainingSchedule:
    """Where a run stands within its budget, and its learning rate there."""

    def __init__(self, budget: Budget, state: dict[str, Any] | None = None):
        """Begin a budget, or go on as `state` says, which `as_dict` returned.

        An unfinished budget goes on where it stopped when `budget` is the same; another one is on top of what was done.
        """
        # Where this budget began, and what was done before it.
        self.budget = budget
        self.first_step = self.step = 0
        self._first_seconds = self._earlier = 0.0
        if state is not None:
            self.step = state["step"]
            self._earlier = state["seconds"]
            # The same budget again means: go on with it.
            unfinished = (state["steps"], state["minutes"]) == (
                budget.steps,
                budget.minutes,
            ) and not state["done"]
            self.first_step = state["first_step"] if unfinished else self.step
            self._first_seconds = state["first_seconds"] if unfinished else self._earlier
        self._start = time.monotonic()

    def as_dict(self) -> dict[str, Any]:
        return {
            "step": self.step,
            "seconds": self.seconds,
            "steps": self.budget.steps,
            "minutes": self.budget.minutes,
            "first_step": self.first_step,
            "first_seconds": self._first_seconds,
            "done": self.done,
        }

    @property
    def seconds(self) -> float:
        """Seconds trained since the run began."""
        return self._earlier + time.monotonic() - self._start

    @property
    def progress(self) -> float:
        """Part in [0, 1] that is done of everything: the steps or seconds before this budget, and the budget."""
        if self.budget.steps is not None:
            return min(1.0, self.step / (self.first_step + self.budget.steps))
        return min(1.0, self.seconds / (self._first_seconds + 60 * (self.budget.minutes or 0)))

    @property
    def done(self) -> bool:
        return self.progress >= 1

    def rate(self, warm_up: int, last: float) -> float:
        """Factor on the peak learning rate: a linear rise, then half a cosine down to `last` at the end of the budget.

        The cosine spans the whole run: a short budget on top of a long run anneals, a long one goes on near the peak.
        """
        # A resumed run has its moments already and needs a short rise only.
        steps = warm_up if self.first_step == 0 else min(warm_up, WARM_UP_AGAIN)
        rise = min(1.0, (self.step - self.first_step + 1) / steps) if steps else 1.0
        return rise * (last + (1 - last) * 0.5 * (1 + math.cos(math.pi * self.progress)))
