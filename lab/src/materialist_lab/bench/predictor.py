"""`bench predictor`: how long a prediction takes, by the paper's protocol (Table 2, "Time").

Uniform noise as the photo, batch 1. `network` is the forward pass alone, what the paper times; `predict` is everything
from the photo to the maps, resizing and refinement included.
"""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch

from materialist.option_kinds import option
from materialist.predict import get_predictor
from materialist.predict.bundled.network import STRIDE, BundledNetwork
from materialist.types import Camera, Photo
from materialist_lab.bench.benchmark import COUNT, COUNT_OR_0, SIZE, Benchmark, Row, names, timed
from materialist_lab.bench.report import Column, Report


@dataclass(frozen=True, kw_only=True)
class PredictorBench(Benchmark):
    """Time predictors."""

    columns = (
        Column("mean_ms", "mean ms", "lower", 1),
        Column("median_ms", "median ms", "lower", 1),
        Column("fastest_ms", "fastest ms", "lower", 1),
        Column("parameters_m", "million parameters", digits=2),
    )

    predictor: str = option("auto", "Names, with commas.", kind="name")
    size: int = option(512, "Width and height of the photo.", **SIZE)
    warmups: int = option(50, "Calls that do not count.", **COUNT_OR_0)
    runs: int = option(500, "Calls that do.", **COUNT)

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        report.settings.update(threads=torch.get_num_threads(), cores=os.cpu_count())
        # The time does not depend on what is in the picture.
        noise = np.random.default_rng(self.seed).random((self.size, self.size, 3), dtype=np.float32)
        photo = Photo(linear=noise, camera=Camera(self.size, self.size), original=noise)
        for spec in names("predictor", self.predictor):
            source: Any = get_predictor(spec, device=self.device)
            network = getattr(source, "network", None)
            # The whole prediction, and where there is one the network alone.
            work: dict[str, Callable[[], Any]] = {
                "predict": partial(source.predict, photo, seed=self.seed)
            }
            weights = {}
            if network is not None:
                weights["parameters_m"] = sum(p.numel() for p in network.parameters()) / 1e6
                work = {"network": forward(network, self.size), **work}
            for name, call in work.items():
                seconds = [timed(call)[1]["seconds"] for _ in range(self.warmups + self.runs)]
                # The first calls allocate memory and choose kernels.
                taken = 1e3 * np.array(seconds[self.warmups :])
                yield {
                    "method": f"{spec} {name}",
                    "sample": 0,
                    **weights,
                    "mean_ms": float(taken.mean()),
                    "median_ms": float(np.median(taken)),
                    "fastest_ms": float(taken.min()),
                }


def forward(network: Any, size: int) -> Callable[[], Any]:
    """The forward pass of the bundled network or MatNet on noise; it waits for the device."""
    device = next(network.parameters()).device
    # Sides that the network can divide, 14 being the patch of MatNet's encoder.
    step = STRIDE if isinstance(network, BundledNetwork) else 14
    side = max(step, round(size / step) * step)
    inputs = [torch.rand(1, 3, side, side, device=device)]
    if isinstance(network, BundledNetwork):
        inputs = [
            inputs[0].contiguous(memory_format=torch.channels_last),
            torch.rand(1, 2, side, side, device=device),
        ]

    def call() -> None:
        with torch.inference_mode():
            network(*inputs)
        # Calls return before the device has finished.
        if device.type == "cuda":
            torch.cuda.synchronize(device)

    return call
