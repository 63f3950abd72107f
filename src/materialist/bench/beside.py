"""`bench beside`: what an inversion costs beside another one."""

from __future__ import annotations

import tempfile
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from materialist.bench.benchmark import Benchmark
from materialist.bench.invert import Case, inversion, photo_case
from materialist.bench.report import Column, Report, write

NOTE = """`materialist invert` as a user runs it: once alone, then twice at the same time, each in a process of its own.
Seconds are wall clock until the last of them ends. Two processes share the processors, so that a ratio of 2 is fair;
more is time that threads take from each other. A first inversion, not counted, fills the kernel cache."""

COLUMNS = (
    Column("alone", "one alone, s", "lower", 1),
    Column("together", "two at once, s", "lower", 1),
    Column("ratio", "two at once / one alone", "lower", 2),
)


@dataclass(frozen=True, kw_only=True)
class BesideBench(Benchmark):
    least: ClassVar[dict[str, int]] = {"size": 16, "runs": 1}

    """Invert one photo alone and twice at once, `runs` times; `data`, `photo` and `size` as in `bench invert`."""

    size: int = 256
    runs: int = 3
    photo: str | None = None

    def run(self, data: Path | None, output: Path) -> None:
        rows: list[dict[str, Any]] = []
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as temporary:
            folder = Path(temporary)
            case = photo_case(data, self.photo, folder, self.size, self.seed, self.device)
            settings = self.settings(data, photo=case.name)
            report = Report("Inversions beside each other", NOTE, settings, COLUMNS, rows, ("alone", "together"))
            options = ["--seed", str(self.seed), "--device", self.device]
            seconds(case, self.size, folder, options, count=1)
            for k in range(self.runs):
                alone, together = (seconds(case, self.size, folder, options, count=n) for n in (1, 2))
                row = {"alone": alone, "together": together, "ratio": together / alone}
                rows.append({"method": f"{self.size} pixels", "sample": f"run {k}", **row})
                write(report, output)


def seconds(case: Case, size: int, folder: Path, options: list[str], *, count: int) -> float:
    """Wall clock of `count` inversions at the same time."""
    with tempfile.TemporaryDirectory(dir=folder) as scratch, ThreadPoolExecutor(count) as pool:
        folders = [Path(scratch) / str(k) for k in range(count)]
        for one in folders:
            one.mkdir()
        start = time.perf_counter()
        list(pool.map(lambda one: inversion(case, size, one, options), folders))
        return time.perf_counter() - start
