"""`bench beside`: what an inversion costs beside another one.

`materialist invert` as a user runs it: once alone, then twice at the same time, each in a process of its own. Seconds
are wall clock until the last of them ends. Two processes share the processors, so that a ratio of 2 is fair; more is
time that threads take from each other. A first inversion, not counted, fills the kernel cache.
"""

import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from materialist.bench.benchmark import COUNT, SIZE, Benchmark, Row
from materialist.bench.invert import inversion, photo_case
from materialist.bench.report import Column, Report
from materialist.option_kinds import option


@dataclass(frozen=True, kw_only=True)
class BesideBench(Benchmark):
    """Invert one photo alone and twice at once; `data` as in `bench invert`."""

    columns = (
        Column("alone", "one alone, s", "lower", 1),
        Column("together", "two at once, s", "lower", 1),
        Column("ratio", "two at once / one alone", "lower", 2),
    )
    plotted = ("alone", "together")

    size: int = option(256, "Longer side.", **SIZE)
    runs: int = option(3, "Times that both are measured.", **COUNT)
    photo: str = option("", "As in `bench invert`.", kind="name")

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        with tempfile.TemporaryDirectory(prefix="materialist-bench-") as temporary:
            case = photo_case(self, data, self.photo, Path(temporary), self.size)
            report.settings["photo"] = case.name

            def seconds(count: int) -> float:
                """Wall clock of `count` inversions at the same time."""
                with tempfile.TemporaryDirectory(dir=temporary) as scratch, ThreadPoolExecutor(count) as pool:
                    folders = [Path(scratch) / str(k) for k in range(count)]
                    for one in folders:
                        one.mkdir()
                    start = time.perf_counter()
                    list(pool.map(lambda one: inversion(self, case, self.size, one), folders))
                    return time.perf_counter() - start

            seconds(1)
            for k in range(self.runs):
                alone, together = seconds(1), seconds(2)
                row = {"alone": alone, "together": together, "ratio": together / alone}
                yield {"method": f"{self.size} pixels", "sample": f"run {k}", **row}
