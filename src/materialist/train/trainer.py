"""The training loop: resumable, on one device or several."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from materialist.errors import InputError
from materialist.io.map_sheet import strip, write_sheet
from materialist.io.samples import Sample, Source
from materialist.metrics.maps import score, summary
from materialist.procedural.photographic import as_photo
from materialist.train import checkpoint, stream
from materialist.train.budget import Budget, Clock
from materialist.train.ending import Ending
from materialist.train.launch import Processes
from materialist.train.recipes import Recipe
from materialist.train.tasks import Batch, Task

KIND = "matnet"
"""What checkpoints call such a run."""
CURVE = "curve.jsonl"
"""Mean of the losses every REPORT_STEPS steps, one JSON object a line."""
SCORES = "scores.jsonl"
"""Figures on the samples kept aside, at every checkpoint; `of` says so, or that there were too few to keep any."""
REPORT_STEPS = 20
ROWS = 6
"""Samples that the sheet shows."""
KEPT_ASIDE, TRAINED_ON = "samples kept aside", "samples trained on"

Note = Callable[[str], None]


@dataclass(frozen=True)
class Habits:
    """How a run is kept, whatever it trains."""

    checkpoint_seconds: float = 300
    score_samples: int = 12
    """Samples kept aside that are scored and drawn at every checkpoint; 0 for none."""
    workers: int = 1
    """Processes that load and augment, for each training process."""
    seed: int = 0

    def __post_init__(self) -> None:
        for option, number in (("workers", self.workers), ("score-samples", self.score_samples)):
            if number < 0:
                raise InputError(f"--{option} is {number}; give 0 or more.")


def score_and_draw(task: Task, network: nn.Module, samples: list[Sample], path: Path) -> dict[str, float]:
    """Mean figures of the network on `samples`, seen as photographs (always the same ones), and a sheet at `path`."""
    rows, strips = [], []
    with torch.inference_mode():
        for k, sample in enumerate(samples):
            photo = as_photo(sample, np.random.default_rng((7, k)))
            predicted = task.predict(network, photo)
            rows.append(score(predicted, photo.truth()))
            if k < ROWS:
                strips.append(strip(photo.image, predicted, photo.truth()))
    write_sheet(strips, path)
    return summary([row for row in rows if row])


class Trainer:
    """One run in one folder."""

    scored_on = ""
    """What the last figures are of: KEPT_ASIDE or TRAINED_ON."""
    interrupted = False
    """Whether Ctrl-C ended it."""

    def __init__(
        self, recipe: Recipe, task: Task, source: Source, folder: Path, *, budget: Budget, habits: Habits | None = None,
        processes: Processes | None = None, resume: bool = False, note: Note = lambda _: None,
    ):  # fmt: skip
        """Start or resume a run. Raises OutputError when FOLDER holds a run and `resume` is off."""
        self.recipe, self.task, self.source, self.folder = recipe, task, source, folder
        self.habits, self.processes, self.note = habits or Habits(), processes or Processes(), note
        self.device = self.processes.device
        state = checkpoint.begun(folder, KIND, resume=resume, device=self.device)
        torch.manual_seed(self.habits.seed)
        self.network = task.network(recipe).to(self.device)
        self.averaged = copy.deepcopy(self.network).requires_grad_(False).eval()
        learnt = [p for p in self.network.parameters() if p.requires_grad]
        self.optimizer = torch.optim.AdamW(_groups(learnt, recipe.weight_decay), lr=recipe.rate, betas=recipe.betas)
        self.epoch = 0
        self.clock = Clock(budget)
        checkpoint.make(folder)
        if state is not None:
            self._restore(state, budget)
        self.wrapped = self.processes.wrap(self.network)
        for text in (*task.notes, *getattr(source, "notes", list)()):
            self.note(text)

    def run(self, progress: Callable[[str, int, int], None] = lambda *_: None) -> dict[str, float]:
        """Train until the budget is spent, or SIGTERM or Ctrl-C comes; returns the last scores.

        Always leaves a checkpoint.
        """
        with Ending() as ending:
            self._train(ending, progress)
            if self.processes.first:
                self.save()
            self.interrupted = ending.interrupted
        return self.score() if self.processes.first and not ending.asked else {}

    def _train(self, ending: Ending, progress: Callable[[str, int, int], None]) -> None:
        losses: dict[str, float] = {}
        count, since = 0, time.monotonic()
        saved = time.monotonic()
        for batch in self._batches():
            found = self._step(batch)
            for name, value in found.items():
                losses[name] = losses.get(name, 0.0) + value
            count += 1
            stop = self.processes.agree(self.clock.done or ending.asked)
            if count == REPORT_STEPS or stop:
                self._report(losses, count, time.monotonic() - since, progress)
                losses, count, since = {}, 0, time.monotonic()
            if stop:
                break
            if self.processes.first and time.monotonic() - saved > self.habits.checkpoint_seconds:
                start = time.monotonic()
                self.save()
                self.score()
                saved = time.monotonic()
                since += saved - start  # the curve tells the speed of training alone

    def save(self) -> None:
        """Write the checkpoint."""
        state = {
            "kind": KIND,
            "recipe": self.recipe.as_dict(),
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "step": self.clock.step,
            "epoch": self.epoch,
            "seconds": self.clock.seconds,
            "random": torch.get_rng_state(),
            "data": {"samples": len(self.source), "seed": getattr(self.source, "seed", lambda: None)()},
        }
        checkpoint.save(self.folder, state)

    def score(self) -> dict[str, float]:
        """Score the averaged weights on samples kept aside; writes a line of SCORES and sheet.png.

        Of a set that is too small to keep any aside, samples that it learns from are scored, and that is told.
        """
        if not self.habits.score_samples:
            return {}
        samples = stream.kept_aside(self.source, self.habits.score_samples)
        if not samples:
            self.note("No sample that is kept aside can be read: no figures.")
            return {}
        network = self.averaged if self.recipe.ema else self.network.eval()
        figures = score_and_draw(self.task, network, samples, self.folder / "sheet.png")
        self.network.train()
        self.scored_on = TRAINED_ON if stream.none_aside(self.source) else KEPT_ASIDE
        line = {"step": self.clock.step, "seconds": round(self.clock.seconds, 1), "of": self.scored_on, **figures}
        checkpoint.append_line(self.folder / SCORES, {k: _rounded(v) for k, v in line.items()})
        names = ("albedo_psnr", "roughness_psnr_pooled", "metallic_psnr_pooled", "normal_angle", "depth_si_log_rmse")
        told = "  ".join(f"{n} {figures[n]:.3g}" for n in names if n in figures)
        few = f"  (of samples trained on: every {stream.KEPT_ASIDE}th of a set is kept aside, and there is none)"
        self.note(told + (few if self.scored_on == TRAINED_ON else ""))
        return figures

    def _batches(self) -> Iterator[Batch]:
        """Epoch after epoch, without end; one is cut short when larger crops are due."""
        while True:
            self.epoch += 1
            size = self.recipe.size_at(self.clock.progress)
            batches = stream.epoch(
                self.source, self.task, number=self.epoch, size=size, batch=self.recipe.batch, seed=self.habits.seed,
                rank=self.processes.rank, world=self.processes.world, workers=self.habits.workers,
            )  # fmt: skip
            for batch in batches:
                yield batch
                if self.recipe.size_at(self.clock.progress) != size:
                    break
            batches.close()

    def _step(self, batch: Batch) -> dict[str, float]:
        """One step of the optimizer; returns the terms of the loss."""
        rate = self.recipe.rate * self.clock.rate(self.recipe.warm_up, self.recipe.last_rate)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        batch = {name: t.to(self.device, non_blocking=True) for name, t in batch.items()}
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self.recipe.bfloat16):
            terms = self.task.terms(self.wrapped, batch)
        total: Tensor = sum(terms.values(), torch.zeros((), device=self.device))
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()
        norm = nn.utils.clip_grad_norm_(self.network.parameters(), self.recipe.clip)
        if bool(torch.isfinite(norm)):
            self.optimizer.step()
            self._average()
        self.clock.step += 1
        return {"loss": total.item(), "norm": norm.item(), **{k: v.item() for k, v in terms.items()}}

    @torch.no_grad()
    def _average(self) -> None:
        """Move the averaged weights; early on they follow faster, so that they are not of the random start."""
        decay = min(self.recipe.ema, (1 + self.clock.step) / (10 + self.clock.step)) if self.recipe.ema else 0.0
        pairs = zip(self.averaged.state_dict().values(), self.network.state_dict().values(), strict=True)
        for mine, theirs in pairs:
            if mine.dtype.is_floating_point:
                mine.lerp_(theirs.to(mine.dtype), 1 - decay)
            else:
                mine.copy_(theirs)

    def _report(self, losses: dict[str, float], count: int, seconds: float, progress: Callable) -> None:
        """One line of the curve."""
        if not self.processes.first or not count:
            return
        line: dict[str, Any] = {"step": self.clock.step, "seconds": self.clock.seconds, "epoch": self.epoch}
        line |= {"rate": self.optimizer.param_groups[0]["lr"]}
        line |= {"per_second": count * self.recipe.batch * self.processes.world / max(seconds, 1e-6)}
        line |= {name: value / count for name, value in losses.items()}
        checkpoint.append_line(self.folder / CURVE, {k: _rounded(v) for k, v in line.items()})
        progress("train", round(1000 * self.clock.progress), 1000)

    def _restore(self, state: dict[str, Any], budget: Budget) -> None:
        """Go on from a checkpoint."""
        if state["recipe"]["network"] != _plain(self.recipe.network) or state["recipe"]["task"] != self.recipe.task:
            raise InputError(f"{self.folder} holds a run of another network; resume it with the options it began with.")
        self.network.load_state_dict(state["network"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimizer.load_state_dict(state["optimizer"])
        torch.set_rng_state(state["random"].cpu())
        self.epoch = state["epoch"]
        self.clock = Clock(budget, step=state["step"], seconds=state["seconds"])
        self.note(f"Resumed at step {self.clock.step}, after {self.clock.seconds / 60:.0f} minutes.")


def _groups(parameters: list[nn.Parameter], decay: float) -> list[dict[str, Any]]:
    """Weights decay, biases and gains do not."""
    return [
        {"params": [p for p in parameters if p.ndim > 1], "weight_decay": decay},
        {"params": [p for p in parameters if p.ndim <= 1], "weight_decay": 0.0},
    ]


def _plain(options: dict[str, Any]) -> dict[str, Any]:
    return {k: list(v) if isinstance(v, tuple) else v for k, v in options.items()}


def _rounded(value: Any) -> Any:
    """Five digits are plenty in a curve; what is not finite becomes None, which JSON has."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.5g}") if math.isfinite(value) else None


__all__ = ["CURVE", "SCORES", "Habits", "Trainer"]
