"""The training of RefractionNet: one process, resumable, its learning curve kept."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional as F

from materialist.errors import InputError, OutputError
from materialist.predict.refraction import weights
from materialist.predict.refraction.crop import BACK_X, MASK, NORMAL_X, SIDE
from materialist.predict.refraction.network import STRIDE, RefractionNet
from materialist.train import checkpoint
from materialist.train.budget import Budget, Clock
from materialist.train.refraction import lessons
from materialist.train.refraction.scores import score
from materialist.types import Array

CURVE = "curve.jsonl"
"""Mean losses every REPORT_STEPS steps."""
SCORES = "scores.jsonl"
"""Figures on the shapes kept aside, at every checkpoint."""
WEIGHTS = "weights.safetensors"
REPORT_STEPS = 50
SOFT = (0.05, 0.02)
"""Added to solid and hollow thickness before logarithms: what is thinner counts little."""


@dataclass(frozen=True)
class Recipe:
    """Everything that decides how the network is trained; stored with its weights."""

    batch: int = 32
    rate: float = 2e-3
    weight_decay: float = 0.02
    warm_up: int = 100
    last_rate: float = 0.01
    ema: float = 0.998
    clip: float = 1.0
    hollow: float = 0.4
    """Weight of the hollow thickness in the loss."""
    logarithm: float = 0.3
    """Weight of the difference of logarithms beside that of the lengths."""
    back: float = 1.0
    """Weight of the normals of the back: one minus the cosine of their error."""
    bfloat16: bool = False
    side: int = 32
    """Pixels on a side of the views at first: smaller ones train faster, and most can be learnt on them."""
    full_size: float = 0.6
    """Part of the run after which views have their full SIDE."""

    def __post_init__(self) -> None:
        if self.side < STRIDE or self.side > SIDE or self.side % STRIDE:
            raise InputError(f"The side is {self.side} pixels; give a multiple of {STRIDE} up to {SIDE}.")
        if self.batch < 1 or not 0 < self.rate < 1:
            raise InputError(f"batch is {self.batch}, the rate {self.rate:g}; give at least 1, and between 0 and 1.")


class Trainer:
    """One run in one folder; `run` trains, keeps a checkpoint, and leaves the averaged weights as float16."""

    def __init__(
        self, folder: Path, data: Path, heldout: Path | None, *, budget: Budget, recipe: Recipe | None = None,
        seed: int = 0, every: float = 180, resume: bool = False, note: Callable[[str], None] = lambda _: None,
    ):  # fmt: skip
        """Start or resume a run. Raises OutputError when FOLDER holds a run and `resume` is off."""
        self.folder, self.data, self.recipe, self.note = folder, data, recipe or Recipe(), note
        self.seed, self.every = seed, every
        self.kept_aside = None if heldout is None else lessons.load(heldout)
        torch.manual_seed(seed)
        self.network = RefractionNet()
        self.averaged = copy.deepcopy(self.network).requires_grad_(False).eval()
        r = self.recipe
        self.optimizer = torch.optim.AdamW(
            self.network.parameters(), r.rate, (0.9, 0.98), weight_decay=r.weight_decay, fused=True
        )
        self.clock, self.epoch = Clock(budget), 0
        exists = (folder / checkpoint.NAME).is_file()
        if exists and not resume:
            raise OutputError(f"{folder} holds a run already; add --resume to go on with it, or choose another folder.")
        folder.mkdir(parents=True, exist_ok=True)
        if exists:
            state = checkpoint.load(folder)
            self.network.load_state_dict(state["network"])
            self.averaged.load_state_dict(state["averaged"])
            self.optimizer.load_state_dict(state["optimizer"])
            for group in self.optimizer.param_groups:
                group["fused"] = True
            self.epoch, self.clock = state["epoch"], Clock(budget, step=state["step"], seconds=state["seconds"])

    def run(self, progress: Callable[[str, int, int], None] = lambda *_: None) -> dict[str, float]:
        """Train until the budget is spent; returns the last figures."""
        total: dict[str, float] = {}
        since = saved = time.monotonic()
        scoring = 0.0  # seconds that do not count for the speed of training
        for batch in self._batches():
            for name, value in self._step(batch).items():
                total[name] = total.get(name, 0.0) + value
            if self.clock.step % REPORT_STEPS == 0:
                speed = REPORT_STEPS * self.recipe.batch / max(time.monotonic() - since - scoring, 1e-6)
                line = {"step": self.clock.step, "seconds": self.clock.seconds, "per_second": speed}
                line |= {k: v / REPORT_STEPS for k, v in total.items()}
                checkpoint.append_line(self.folder / CURVE, {k: float(f"{v:.5g}") for k, v in line.items()})
                progress("train", round(1000 * self.clock.progress), 1000)
                total, since, scoring = {}, time.monotonic(), 0.0
            if self.clock.done:
                break
            if time.monotonic() - saved > self.every:
                start = time.monotonic()
                self.save()
                saved = time.monotonic()
                scoring += saved - start
        return self.save()

    def save(self) -> dict[str, float]:
        """Write the checkpoint, the scores of the averaged weights, and these as float16."""
        figures = {} if self.kept_aside is None else score(self.averaged, self.kept_aside)
        state = {
            "network": self.network.state_dict(), "averaged": self.averaged.state_dict(),
            "optimizer": self.optimizer.state_dict(), "step": self.clock.step, "epoch": self.epoch,
            "seconds": self.clock.seconds,
        }  # fmt: skip
        checkpoint.save(self.folder, state)
        line = {"step": self.clock.step, "seconds": round(self.clock.seconds, 1)}
        checkpoint.append_line(self.folder / SCORES, line | {k: round(v, 4) for k, v in figures.items()})
        facts = {
            **line, "views": self.clock.step * self.recipe.batch, "recipe": asdict(self.recipe), "scores": figures
        }  # fmt: skip
        weights.save(self.folder / WEIGHTS, self.averaged, facts)
        self.note(f"step {self.clock.step}  " + "  ".join(f"{k} {v:.3f}" for k, v in figures.items()))
        return figures

    def _batches(self) -> Iterator[dict[str, Tensor]]:
        """Epoch after epoch over the views that are there, in random order, every other one mirrored."""
        known, side, views = -1, 0, {}
        while True:
            wanted = SIDE if self.clock.progress >= self.recipe.full_size else self.recipe.side
            if (lessons.count(self.data), wanted) != (known, side):  # a set that is still being made grows
                known, side = lessons.count(self.data), wanted
                views = smaller(lessons.load(self.data), side)
            self.epoch += 1
            rng = np.random.default_rng([self.seed, self.epoch])
            order, size = rng.permutation(len(views["maps"])), self.recipe.batch
            if len(order) < size:
                order = np.resize(order, size)
            for k in range(0, len(order) - size + 1, size):
                yield prepared(views, order[k : k + size], rng)

    def _step(self, batch: dict[str, Tensor]) -> dict[str, float]:
        recipe = self.recipe
        for group in self.optimizer.param_groups:
            group["lr"] = recipe.rate * self.clock.rate(recipe.warm_up, recipe.last_rate)
        with torch.autocast("cpu", torch.bfloat16, enabled=recipe.bfloat16):
            found = self.network(batch["maps"])
        terms = losses(found, batch, recipe)
        loss = sum(terms.values(), torch.zeros(()))
        self.optimizer.zero_grad(set_to_none=True)
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.network.parameters(), recipe.clip)
        self.optimizer.step()
        self.clock.step += 1
        decay = min(recipe.ema, (1 + self.clock.step) / (10 + self.clock.step))
        with torch.no_grad():
            torch._foreach_lerp_(list(self.averaged.parameters()), list(self.network.parameters()), 1 - decay)
        return {"loss": loss.item(), **{k: v.item() for k, v in terms.items()}}


def prepared(views: dict[str, Array], chosen: Array, rng: np.random.Generator) -> dict[str, Tensor]:
    """A batch: maps [B, C, S, S] and target [B, 5, S, S] float32, hollow [B]; mirrored and recoloured at random."""
    maps, target = views["maps"][chosen].astype(np.float32), views["target"][chosen].astype(np.float32)
    flip = rng.random(len(chosen)) < 0.5
    maps[flip], target[flip] = maps[flip, ..., ::-1], target[flip, ..., ::-1]
    maps[flip, NORMAL_X] *= -1
    target[flip, BACK_X] *= -1
    gain, order = rng.uniform(0.7, 1.2, (len(chosen), 3, 1, 1)), rng.permutation(3)
    inside = maps[:, MASK : MASK + 1]
    maps[:, :3] = (np.clip((maps[:, :3] + 0.5 * inside)[:, order] * gain, 0, 1) - 0.5) * inside
    hollow = torch.from_numpy(views["hollow"][chosen].astype(np.float32))
    return {"maps": torch.from_numpy(maps), "target": torch.from_numpy(target), "hollow": hollow}


def smaller(views: dict[str, Array], side: int, at_a_time: int = 256) -> dict[str, Array]:
    """Views at side x side pixels: means over what is known; a pixel is inside where half of it is."""
    if side == views["maps"].shape[-1]:
        return views
    count = len(views["maps"])
    result = {name: np.empty((*views[name].shape[:2], side, side), np.float16) for name in ("maps", "target")}
    shrink = lambda x: F.interpolate(torch.from_numpy(x), (side, side), mode="area").numpy()  # noqa: E731
    for k in range(0, count, at_a_time):
        part = slice(k, k + at_a_time)
        maps, target = views["maps"][part].astype(np.float32), views["target"][part].astype(np.float32)
        for name, values, weight in (
            ("maps", maps, maps[:, MASK : MASK + 1]), ("target", target, (target[:, :1] > 0).astype(np.float32))
        ):  # fmt: skip
            share = shrink(np.ascontiguousarray(weight))
            result[name][part] = np.where(share > 0.5, shrink(values) / np.maximum(share, 1e-6), 0)
    return {**result, "hollow": views["hollow"]}


def losses(found: Tensor, batch: dict[str, Tensor], recipe: Recipe) -> dict[str, Tensor]:
    """The terms of the loss of predictions [B, 5, S, S]: relative length and logarithm, solid and hollow; the back."""
    target, maps = batch["target"], batch["maps"]
    inside = maps[:, MASK] * (target[:, 0] > 0)
    count = inside.sum((1, 2)).clamp(min=1)
    terms = {}
    for k, (name, share) in enumerate((("solid", 1.0), ("hollow", recipe.hollow))):
        a, b = found[:, k], target[:, k]
        mean = (b * inside).sum((1, 2)) / count
        length = ((a - b).abs() * inside).sum((1, 2)) / count / (mean + 2 * SOFT[k])
        ratio = ((a + SOFT[k]).log() - (b + SOFT[k]).log()).abs()
        each = length + recipe.logarithm * (ratio * inside).sum((1, 2)) / count
        if k == 1:  # only hollow shapes have walls to learn from
            each = each * batch["hollow"] / batch["hollow"].mean().clamp(min=0.1)
        terms[name] = share * each.mean()
    # Means over pixels of smaller views are shorter than 1 where the back is bent: they say less there.
    cosine = (found[:, BACK_X:] * target[:, BACK_X:]).sum(1)
    length = target[:, BACK_X:].square().sum(1).clamp(min=1e-8).sqrt()
    terms["back"] = recipe.back * (((length - cosine) * inside).sum((1, 2)) / count).mean()
    return terms
