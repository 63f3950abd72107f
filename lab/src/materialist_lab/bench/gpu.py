"""`bench gpu`: what each stage costs on the processor and on a CUDA card.

Wall seconds, each device in a process of its own; with `--device cpu` or `cuda` one of them in this process. `bundled
network` is the median forward pass at 512 x 512 (the paper: 18 ms on its card), `step` one of the material fit with
gradients, cached and by Mitsuba's PRB; edit and glass are of what `click` selects. Quote a second run: one compiles.
"""

import json
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import torch

from materialist import pipeline
from materialist.edits.composite.composite import composite
from materialist.edits.glass.glass import glass
from materialist.edits.material.material import edit
from materialist.edits.select.select import select
from materialist.option_kinds import option
from materialist.render.variant import usable_gpus
from materialist_lab.bench.benchmark import COUNT, SIZE, Benchmark, Row, materialist, numbers, timed
from materialist_lab.bench.invert import STAGES, stages, step_row
from materialist_lab.bench.predictor import PredictorBench
from materialist_lab.bench.report import Column, Report


@dataclass(frozen=True, kw_only=True)
class GpuBench(Benchmark):
    """Time every stage of one photo; `data` is not used."""

    columns = (Column("cpu", "cpu s", digits=3), Column("cuda", "cuda s", digits=3))

    photo: str = option("example:coffee", "A file or example:NAME.", kind="name")
    click: str = option("150,230", "Where its object is, x and y at 512 pixels.", kind="name")
    size: int = option(512, "Longer side.", **SIZE)
    runs: int = option(50, "Forward passes; a tenth of it more do not count.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        # Both libraries must see it: an inversion uses both.
        usable = usable_gpus() and torch.cuda.is_available()
        report.settings["card"] = (
            torch.cuda.get_device_name() if usable else "none that Mitsuba and PyTorch can use"
        )
        if self.device != "auto":
            yield from (
                {"method": k, "sample": self.photo, self.device: s}
                for k, s in self._measured(report)
            )
            return
        # --- Each device in a process of its own ---
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as folder:
            for device in ("cpu", "cuda")[: 1 + usable]:  # a process keeps its device
                options = asdict(replace(self, device=device))
                arguments = [
                    f"--{name.replace('_', '-')}={value}" for name, value in options.items()
                ]
                materialist("bench", "gpu", "-o", f"{folder}/{device}", *arguments)
                yield from json.loads(Path(folder, device, "report.json").read_text())["rows"]

    def _measured(self, report: Report) -> Iterator[tuple[str, float]]:
        """(stage, seconds) on this process's device."""
        shared: dict[str, Any] = {"seed": self.seed, "device": self.device}
        speed = PredictorBench(
            predictor="bundled", warmups=max(1, self.runs // 10), runs=self.runs, **shared
        )
        for row in speed.rows(None, report):
            yield row["method"], row["median_ms"] / 1000
        scene, cost = timed(pipeline.invert, self.photo, size=self.size, **shared)
        spent = stages(list(scene.report.stages), cost["seconds"]).items()
        yield from (
            (f"inversion, {STAGES.get(key.removesuffix('_s'), 'other')}", seconds)
            for key, seconds in spent
        )
        yield "inversion", cost["seconds"]
        mask = select(
            scene, click=[x * self.size / 512 for x in numbers("click", self.click, 0, 512)]
        )
        changes = {
            "edit": lambda: edit(scene, mask, hue=120),
            "glass": lambda: glass(scene, mask, **shared),
        }
        for name, change in changes.items():
            yield (
                name,
                timed(lambda change=change: composite(scene, change(), **shared))[1]["seconds"],
            )
        step = step_row(scene.photo, scene.prior, self)
        yield from {
            "step, cached": step["cached_step_ms"] / 1000,
            "step, PRB": step["prb_step_s"],
        }.items()
