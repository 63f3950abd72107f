"""`bench predictor`: how long a prediction takes, by the paper's protocol (Table 2, "Time").

Noise as input, batch 1, 50 warm-ups, then 500 runs; mean and median. `network` is the forward pass alone, which is what
the paper times; `predict` is everything from the photo to the maps.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.types import Camera, Photo

COLUMNS = (
    Column("mean_ms", "mean ms", "lower", 1),
    Column("median_ms", "median ms", "lower", 1),
    Column("fastest_ms", "fastest ms", "lower", 1),
    Column("parameters_m", "million parameters", digits=2),
)
NOTE = (
    "Uniform noise as the photo, batch 1. `network` is the forward pass alone, what the paper times; `predict` is "
    "everything from the photo to the maps, resizing and refinement included."
)


@dataclass(frozen=True, kw_only=True)
class PredictorBench(Benchmark):
    """Time predictors (comma-separated) on a square of `size` pixels; `threads` 0 leaves their number as it is."""

    least: ClassVar = {"runs": 1, "size": 32}

    predictor: str = "auto"
    size: int = 512
    warmups: int = 50
    runs: int = 500
    threads: int = 0

    def run(self, data: Path | None, output: Path) -> None:
        import torch

        if self.threads:
            torch.set_num_threads(self.threads)
        from materialist.bench.predictors import opened, specs_of

        noise = np.random.default_rng(self.seed).random((self.size, self.size, 3), dtype=np.float32)
        photo = Photo(linear=noise, camera=Camera(self.size, self.size), original=noise)
        rows = []
        for spec in specs_of(self.predictor):
            source = opened(spec, self.device)
            network = getattr(source, "network", None)
            weights = {} if network is None else {"parameters_m": sum(p.numel() for p in network.parameters()) / 1e6}
            work: dict[str, Callable[[], Any]] = {"predict": partial(source.predict, photo, seed=self.seed)}
            if network is not None:
                work = {"network": forward(network, self.size), **work}
            for name, call in work.items():
                rows.append(
                    {"method": f"{spec} {name}", "sample": 0, **weights, **timed(call, self.warmups, self.runs)}
                )
        settings = self.settings(data, threads=torch.get_num_threads(), cores=os.cpu_count())
        write(Report("Time of a prediction", NOTE, settings, COLUMNS, rows, plotted=("median_ms",)), output)


def timed(call: Callable[[], Any], warmups: int, runs: int) -> dict[str, float]:
    """Milliseconds of `call` after warm-ups: mean_ms, median_ms, fastest_ms."""
    for _ in range(warmups):
        call()
    taken = np.empty(runs)
    for k in range(runs):
        start = time.perf_counter()
        call()
        taken[k] = 1e3 * (time.perf_counter() - start)
    return {"mean_ms": float(taken.mean()), "median_ms": float(np.median(taken)), "fastest_ms": float(taken.min())}


def forward(network: Any, size: int) -> Callable[[], Any]:
    """The forward pass of the bundled network or MatNet on noise; it waits for the device."""
    import torch

    from materialist.predict.bundled.network import STRIDE, BundledNetwork

    device = next(network.parameters()).device
    step = STRIDE if isinstance(network, BundledNetwork) else 14
    side = max(step, round(size / step) * step)
    inputs = [torch.rand(1, 3, side, side, device=device)]
    if isinstance(network, BundledNetwork):
        inputs = [inputs[0].contiguous(memory_format=torch.channels_last), torch.rand(1, 2, side, side, device=device)]

    def call() -> None:
        with torch.inference_mode():
            network(*inputs)
        if device.type == "cuda":
            torch.cuda.synchronize(device)

    return call
