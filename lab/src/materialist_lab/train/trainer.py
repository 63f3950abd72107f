"""The training loop of all networks, resumable."""

import copy
import math
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from materialist.errors import InputError
from materialist.io.atomic import make_folder, writing
from materialist.stopping import stop_requests
from materialist.types import Progress
from materialist_lab.train import checkpoint, stream
from materialist_lab.train.schedule import Budget, TrainingSchedule
from materialist_lab.train.task import Batch, Task

Note = Callable[[str], None]


@dataclass(frozen=True)
class RunOptions:
    """How a run is kept, whatever it trains."""

    checkpoint_seconds: float = 300
    """Seconds between checkpoints, each with its scores."""
    report_steps: int = 20
    """Steps of which a line of the curve is the mean."""
    workers: int = 0
    """Processes that load and augment; 0 for the training process itself."""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.workers < 0:
            raise InputError(f"--workers is {self.workers}; give 0 or more.")


class Trainer:
    """One run of a task in one folder: checkpoint.pt, weights.safetensors, curve.jsonl and scores.jsonl."""

    interrupted = False
    """Whether Ctrl-C ended it."""

    def __init__(
        self,
        task: Task,
        folder: Path,
        *,
        budget: Budget,
        options: RunOptions | None = None,
        device: str = "cpu",
        resume: bool = False,
        note: Note = lambda _: None,
    ):
        """Start or resume a run.

        Raises OutputError when FOLDER holds a run and `resume` is off, InputError when that run is of another network.
        """
        # --- The run in the folder, if it is resumed ---
        self.task = task
        self.recipe = task.recipe
        self.folder = folder
        self.note = note
        self.options = options or RunOptions()
        self.device = torch.device(device)
        state = checkpoint.load(folder, task.kind, resume=resume, device=self.device)
        self._bfloat16 = self.recipe.uses_bfloat16(self.device)
        torch.manual_seed(self.options.seed)
        torch.backends.cudnn.benchmark = self.device.type == "cuda"
        # --- The network, and the average of its weights ---
        self.network = task.network().to(self.device)
        self.averaged = copy.deepcopy(self.network).requires_grad_(False).eval()
        self._learnt = [p for p in self.network.parameters() if p.requires_grad]
        pairs = zip(self.averaged.parameters(), self.network.parameters(), strict=True)
        self._averages = [mine for mine, theirs in pairs if theirs.requires_grad]
        # --- The optimiser: biases and scales of normalisation are not decayed ---
        decayed = [p for p in self._learnt if p.ndim > 1]
        others = [p for p in self._learnt if p.ndim <= 1]
        self.optimizer = torch.optim.AdamW(
            [
                {"params": decayed, "weight_decay": self.recipe.weight_decay},
                {"params": others, "weight_decay": 0.0},
            ],
            lr=self.recipe.rate,
            betas=self.recipe.betas,
            fused=True,
        )
        # --- Where the run stands ---
        self.schedule = TrainingSchedule(budget, state and state["schedule"])
        self.epoch = 1
        self.batch = 0
        self.last_scores: dict[str, Any] = {}
        if state is not None:
            self._restore(state)
        with writing(folder):
            make_folder(folder)
        for text in task.notes:
            note(text)

    def fit(self, progress: Progress = lambda *_: None) -> dict[str, Any]:
        """Train until the budget is spent, or SIGTERM or Ctrl-C comes; returns the last scores, none after a signal.

        Always leaves a checkpoint and the averaged weights.
        """
        # The checkpoint is written whatever ends the run.
        with stop_requests() as stop:
            try:
                self._train(stop, progress)
                self.interrupted = signal.SIGINT in stop
                return {} if stop else self.score()
            finally:
                self.save()

    def _train(self, stop: list[int], progress: Progress) -> None:
        losses: dict[str, float] = {}
        count = 0
        since = time.monotonic()
        saved = time.monotonic()
        for batch in self._batches():
            for name, value in self._step(batch).items():
                losses[name] = losses.get(name, 0.0) + value
            count += 1
            done = self.schedule.done or bool(stop)
            # --- A point of the curve ---
            if self.schedule.step % self.options.report_steps == 0 or done:
                self._report(losses, count, time.monotonic() - since, progress)
                losses = {}
                count = 0
                since = time.monotonic()
            if done:
                break
            # --- Scores and a checkpoint now and then ---
            if time.monotonic() - saved > self.options.checkpoint_seconds:
                start = time.monotonic()
                self.score()
                self.save()
                saved = time.monotonic()
                since += saved - start  # the curve tells the speed of training alone

    def save(self) -> None:
        # --- Weights to predict with, and how they came about ---
        schedule = self.schedule.as_dict()
        facts = {
            "step": schedule["step"],
            "minutes": round(schedule["seconds"] / 60, 1),
            "examples": schedule["step"] * self.recipe.batch,
            "recipe": asdict(self.recipe),
            "data": self.task.data(),
            "scores": self.last_scores,
        }
        self.averaged.save(self.folder / checkpoint.WEIGHTS, facts)
        # --- Everything that going on needs ---
        state = {
            "kind": self.task.kind,
            "architecture": self.network.architecture.as_dict(),
            "network": self.network.state_dict(),
            "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(),
            "schedule": schedule,
            "epoch": self.epoch,
            "batch": self.batch,
            "random": torch.get_rng_state(),
            "scores": self.last_scores,
        }
        checkpoint.save(self.folder, state)

    def score(self) -> dict[str, Any]:
        """Score the averaged weights; writes a line of scores.jsonl."""
        scores = self.task.scores(self.averaged, self.folder)
        self.last_scores = {name: _rounded(value) for name, value in scores.items()}
        line = {
            "step": self.schedule.step,
            "seconds": round(self.schedule.seconds, 1),
            **self.last_scores,
        }
        if scores:
            checkpoint.append_line(self.folder / checkpoint.SCORES, line)
        figures = [f"{name} {value}" for name, value in self.last_scores.items()]
        figures = figures or ["no scores, since the data are too few to keep some aside"]
        self.note("  ".join([f"step {self.schedule.step}", *figures]))
        return scores

    def _batches(self) -> Iterator[Batch]:
        """Epoch after epoch, without end; within one, pictures become larger when the recipe says so."""
        while True:
            side = self.recipe.side_at(self.schedule.progress)
            batches = stream.epoch(
                self.task,
                number=self.epoch,
                side=side,
                batch=self.recipe.batch,
                seed=self.options.seed,
                skip=self.batch,
                workers=self.options.workers,
                device=self.device,
            )
            for batch in batches:
                self.batch += 1
                yield batch
                # The side grows within a pass: go on with the rest of it at the new side.
                if self.recipe.side_at(self.schedule.progress) != side:
                    break
            else:
                self.epoch = self.epoch + 1
                self.batch = 0
            batches.close()

    def _step(self, batch: Batch) -> dict[str, float]:
        """One step of the optimiser; returns the terms of the loss."""
        # --- Forward ---
        rate = self.recipe.rate * self.schedule.rate(self.recipe.warm_up, self.recipe.last_rate)
        for group in self.optimizer.param_groups:
            group["lr"] = rate
        with torch.autocast(self.device.type, torch.bfloat16, enabled=self._bfloat16):
            terms = self.task.losses(self.network, batch)
        total: Tensor = sum(terms.values(), torch.zeros((), device=self.device))
        # --- Backward; a gradient that is not finite changes nothing ---
        self.optimizer.zero_grad(set_to_none=True)
        total.backward()
        norm = nn.utils.clip_grad_norm_(self._learnt, self.recipe.clip)
        self.schedule.step += 1
        if bool(torch.isfinite(norm)):
            self.optimizer.step()
            self._average()
        values = torch.stack([total.detach(), norm, *(v.detach() for v in terms.values())]).tolist()
        return dict(zip(("loss", "norm", *terms), values, strict=True))

    @torch.no_grad()
    def _average(self) -> None:
        """Move the averaged weights; early on they follow faster, so that they forget the random start."""
        decay = (
            min(self.recipe.ema, (1 + self.schedule.step) / (10 + self.schedule.step))
            if self.recipe.ema
            else 0.0
        )
        torch._foreach_lerp_(self._averages, self._learnt, 1 - decay)  # type: ignore[arg-type]
        # Statistics of normalisation are averages already.
        for mine, theirs in zip(self.averaged.buffers(), self.network.buffers(), strict=True):
            mine.copy_(theirs)

    def _report(
        self, losses: dict[str, float], count: int, seconds: float, progress: Progress
    ) -> None:
        line: dict[str, Any] = {
            "step": self.schedule.step,
            "seconds": self.schedule.seconds,
            "epoch": self.epoch,
        }
        line |= {"rate": self.optimizer.param_groups[0]["lr"]}
        line |= {"per_second": count * self.recipe.batch / max(seconds, 1e-6)}
        line |= {name: value / count for name, value in losses.items()}
        checkpoint.append_line(
            self.folder / checkpoint.CURVE, {k: _rounded(v) for k, v in line.items()}
        )
        progress("train", round(1000 * self.schedule.progress), 1000)

    def _restore(self, state: dict[str, Any]) -> None:
        # Loading would fail in the middle, with a message about tensors.
        if state["architecture"] != self.network.architecture.as_dict():
            raise InputError(
                f"{self.folder} holds a run of another network; resume it with the options it began with."
            )
        self.network.load_state_dict(state["network"])
        self.averaged.load_state_dict(state["averaged"])
        self.optimizer.load_state_dict(state["optimizer"])
        torch.set_rng_state(state["random"].cpu())
        self.epoch = state["epoch"]
        self.batch = state["batch"]
        self.last_scores = state["scores"]
        self.note(
            f"Resumed at step {self.schedule.step}, after {self.schedule.seconds / 60:.0f} minutes."
        )


def _rounded(value: Any) -> Any:
    """Five digits are plenty in a log; a number that is not finite becomes None, which JSON has."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.5g}") if math.isfinite(value) else None
