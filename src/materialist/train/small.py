"""The training of the small networks: one process, resumable, its learning curve kept."""

from __future__ import annotations

import copy
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

import torch
from torch import Tensor, nn

from materialist.errors import InputError
from materialist.train import checkpoint
from materialist.train.budget import Budget, Clock
from materialist.train.ending import Ending
from materialist.train.launch import place_of

CURVE = "curve.jsonl"
"""Mean losses of the steps since the last line, every REPORT_STEPS steps."""
SCORES = "scores.jsonl"
"""Figures on what is kept aside, at every checkpoint."""
WEIGHTS = "weights.safetensors"
REPORT_STEPS = 50


@dataclass(frozen=True)
class Recipe:
    """What decides how a small network is trained; stored with its weights."""

    batch: int = 32
    rate: float = 2e-3
    weight_decay: float = 0.02
    warm_up: int = 100
    last_rate: float = 0.01
    ema: float = 0.998
    clip: float = 1.0
    bfloat16: bool = False

    def __post_init__(self) -> None:
        if self.batch < 1 or not 0 < self.rate < 1:
            raise InputError(f"batch is {self.batch}, the rate {self.rate:g}; give at least 1, and between 0 and 1.")


class Run(ABC):
    """One run in one folder; `run` trains, keeps a checkpoint, and leaves the averaged weights as float16."""

    kind: ClassVar[str]
    """What checkpoints call such a run: the name of its command."""
    interrupted = False
    """Whether Ctrl-C ended it."""

    def __init__(
        self, folder: Path, network: Callable[[], nn.Module], recipe: Recipe, *, budget: Budget, seed: int = 0,
        every: float = 180, resume: bool = False, note: Callable[[str], None] = lambda _: None, device: str = "auto",
    ):  # fmt: skip
        """Start or resume a run. Raises OutputError when FOLDER holds a run and `resume` is off, InputError when it is
        of another network, SetupError when there is no such device."""
        self.device = place_of(device)
        state = checkpoint.begun(folder, self.kind, resume=resume, device=self.device)
        self.folder, self.recipe, self.note, self.seed, self.every = folder, recipe, note, seed, every
        torch.manual_seed(seed)
        self.network: Any = network().to(self.device)
        self.averaged: Any = copy.deepcopy(self.network).requires_grad_(False).eval()
        learnt = [p for p in self.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(
            learnt, recipe.rate, (0.9, 0.98), weight_decay=recipe.weight_decay, fused=True
        )
        self.clock, self.epoch = Clock(budget), 0
        checkpoint.make(folder)
        if state is not None:
            self._restore(state, budget)

    @abstractmethod
    def batches(self) -> Iterator[dict[str, Tensor]]:
        """Batches without end; the network sees `maps`."""

    @abstractmethod
    def terms(self, found: Tensor, batch: dict[str, Tensor]) -> dict[str, Tensor]:
        """Weighted terms of the loss of an answer, by name."""

    @abstractmethod
    def figures(self) -> dict[str, float]:
        """Scores of the averaged weights on what is kept aside; none where nothing is."""

    @abstractmethod
    def write(self, path: Path, facts: dict[str, Any]) -> None:
        """The averaged weights as the package reads them."""

    def run(self, progress: Callable[[str, int, int], None] = lambda *_: None) -> dict[str, float]:
        """Train until the budget is spent, or SIGTERM or Ctrl-C comes; returns the last figures.

        Always leaves a checkpoint.
        """
        with Ending() as ending:
            self._train(ending, progress)
            self.interrupted = ending.interrupted
            return self.save()

    def _train(self, ending: Ending, progress: Callable[[str, int, int], None]) -> None:
        total: dict[str, float] = {}
        count = 0
        since = saved = time.monotonic()
        scoring = 0.0  # seconds that do not count for the speed of training
        for batch in self.batches():
            for name, value in self._step(batch).items():
                total[name] = total.get(name, 0.0) + value
            count += 1
            if self.clock.step % REPORT_STEPS == 0:
                speed = count * self.recipe.batch / max(time.monotonic() - since - scoring, 1e-6)
                line = {"step": self.clock.step, "seconds": self.clock.seconds, "per_second": speed}
                line |= {k: v / count for k, v in total.items()}
                checkpoint.append_line(self.folder / CURVE, {k: float(f"{v:.5g}") for k, v in line.items()})
                progress("train", round(1000 * self.clock.progress), 1000)
                total, count, since, scoring = {}, 0, time.monotonic(), 0.0
            if self.clock.done or ending.asked:
                break
            if time.monotonic() - saved > self.every:
                start = time.monotonic()
                self.save()
                saved = time.monotonic()
                scoring += saved - start

    def save(self) -> dict[str, float]:
        """Write the checkpoint, the scores of the averaged weights, and these as float16."""
        self.averaged.cpu()  # where it is judged, and written from
        figures = self.figures()
        state = {
            "kind": self.kind, "network": self.network.state_dict(), "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(), "step": self.clock.step, "epoch": self.epoch,
            "seconds": self.clock.seconds,
        }  # fmt: skip
        checkpoint.save(self.folder, state)
        line = {"step": self.clock.step, "seconds": round(self.clock.seconds, 1)}
        checkpoint.append_line(self.folder / SCORES, line | {k: round(v, 4) for k, v in figures.items()})
        facts = {
            **line, "views": self.clock.step * self.recipe.batch, "recipe": asdict(self.recipe), "scores": figures
        }  # fmt: skip
        self.write(self.folder / WEIGHTS, facts)
        self.averaged.to(self.device)
        self.note(f"step {self.clock.step}  " + "  ".join(f"{k} {v:.3f}" for k, v in figures.items()))
        return figures

    def _restore(self, state: dict[str, Any], budget: Budget) -> None:
        """Go on from a checkpoint."""
        try:
            self.network.load_state_dict(state["network"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimizer.load_state_dict(state["optimizer"])
        except (RuntimeError, ValueError) as error:
            raise InputError(
                f"{self.folder} holds a run of another network than that of `train {self.kind}`; choose another folder."
            ) from error
        for group in self.optimizer.param_groups:
            group["fused"] = True
        self.epoch, self.clock = state["epoch"], Clock(budget, step=state["step"], seconds=state["seconds"])

    def _step(self, batch: dict[str, Tensor]) -> dict[str, float]:
        recipe = self.recipe
        batch = {name: value.to(self.device) for name, value in batch.items()}
        for group in self.optimizer.param_groups:
            group["lr"] = recipe.rate * self.clock.rate(recipe.warm_up, recipe.last_rate)
        with torch.autocast(self.device.type, torch.bfloat16, enabled=recipe.bfloat16):
            found = self.network(batch["maps"])
        terms = self.terms(found, batch)
        loss = sum(terms.values(), torch.zeros((), device=self.device))
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        norm = torch.nn.utils.clip_grad_norm_(self.network.parameters(), recipe.clip)
        self.clock.step += 1
        if not bool(torch.isfinite(norm)):
            return {"loss": loss.item(), **{k: v.item() for k, v in terms.items()}}
        self.optimizer.step()
        decay = min(recipe.ema, (1 + self.clock.step) / (10 + self.clock.step))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.averaged.parameters()), list(self.network.parameters()), 1 - decay)
        return {"loss": loss.item(), **{k: v.item() for k, v in terms.items()}}
