"""`bench batch`: what many photos cost together, beside one after the other, by number of workers."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from materialist.batches.photos import list_photos
from materialist.batches.results import package_hash, together
from materialist.batches.task import SINGLE_THREAD
from materialist.bench.benchmark import Benchmark
from materialist.bench.report import Column, Report, write
from materialist.errors import InputError, MaterialistError

SINGLE = "single inversions, one after the other"
EXAMPLES = ("example:cat", "example:coffee", "example:rocket", "example:astronaut")
"""The photos without `data`."""

NOTE = """The same photos, run as a user runs them: first `materialist invert` on each, in a process of its own with one
thread; then `materialist batch` on all of them, with each number of workers (a thread each). Seconds are wall clock
from start to end, processor seconds those of all processes together, which other work on the machine hardly changes.
The overhead compares with the single inversions: negative where starting Python and compiling kernels once pays. The
results must be the same by hash, or the benchmark fails."""

COLUMNS = (
    Column("seconds", "s", "lower", 1),
    Column("cpu_seconds", "processor s", "lower", 1),
    Column("seconds_per_photo", "s a photo", "lower", 2),
    Column("overhead_percent", "overhead, % of s", "lower", 1),
    Column("cpu_overhead_percent", "overhead, % of processor s", "lower", 1),
    Column("peak_mb", "peak MB of a process", "lower", 0),
)


@dataclass(frozen=True, kw_only=True)
class BatchBench(Benchmark):
    """Invert `photos` photos at `size` pixels each way; write the report into `output`.

    `data` is a folder of photos (those of data/photos where there is one), else the built-in examples are used.
    Raises InputError for bad options, MaterialistError where the ways give different results.
    """

    least: ClassVar = {"photos": 1, "size": 16}

    photos: int = 4
    size: int = 128
    workers: str | int = "1,2"

    def run(self, data: Path | None, output: Path) -> None:
        counts = _counts(self.workers)
        chosen = _chosen(data, self.photos, output)
        rows: list[dict[str, Any]] = []
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            listing = place / "photos.txt"
            listing.write_text("\n".join(chosen) + "\n", "utf-8")
            options = ["--size", str(self.size), "--seed", str(self.seed), "--device", self.device, "--json"]
            begin = _usage()
            hashes = {}
            for k, photo in enumerate(chosen):
                _command("invert", photo, "-o", str(place / f"single/{k}.scene"), *options)
                hashes[photo] = package_hash(place / f"single/{k}.scene")
            rows.append(_row(SINGLE, begin, len(chosen), None))
            for count in counts:
                begin, runs = _usage(), place / f"runs-{count}"
                _command("batch", str(listing), "-o", str(runs), "--workers", str(count), *options)
                rows.append(_row(f"batch, {count} worker{'s' if count > 1 else ''}", begin, len(chosen), rows[0]))
                summary = json.loads((runs / "summary.json").read_text("utf-8"))
                rows[-1]["peak_mb"] = max(row["peak_rss_mb"] for row in summary["rows"])
                if together((row["id"], row["scene_hash"]) for row in summary["rows"]) != together(hashes.items()):
                    raise MaterialistError(f"A batch with {count} workers gave other scenes than single inversions.")
                write(
                    Report("Many photos", NOTE, self.settings(data), COLUMNS, rows, ("seconds", "cpu_seconds")), output
                )


def _counts(workers: str | int) -> list[int]:
    try:
        counts = [int(part) for part in str(workers).split(",")]
    except ValueError:
        counts = [0]
    if min(counts) < 1:
        raise InputError(f"workers is {workers}; give whole numbers such as 1,2.")
    return counts


def _chosen(data: Path | None, photos: int, output: Path) -> list[str]:
    """Photos as texts for the command line, spread over those there are."""
    if data is None:
        return list(EXAMPLES[:photos])
    below = data / "photos"
    found = [photo.location for photo in list_photos(below if below.is_dir() else data, runs=output)]
    return found[:: max(1, len(found) // photos)][:photos]


def _command(*arguments: str) -> None:
    """Run `materialist`; raises MaterialistError with what it said when it fails."""
    # A thread for each worker, and for the single inversions too: what is compared is the same work.
    environment = {**os.environ, **SINGLE_THREAD}
    command = [sys.executable, "-m", "materialist", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env=environment)
    if done.returncode:
        raise MaterialistError(f"{' '.join(command[2:])} failed: {done.stdout[-500:]} {done.stderr[-500:]}")


def _usage() -> tuple[float, float]:
    """Wall clock, and processor seconds of all processes that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), children.ru_utime + children.ru_stime


def _row(method: str, begin: tuple[float, float], photos: int, single: dict[str, Any] | None) -> dict[str, Any]:
    seconds, cpu = (after - before for after, before in zip(_usage(), begin, strict=True))
    row = {"method": method, "sample": "all", "seconds": seconds, "cpu_seconds": cpu}
    row["seconds_per_photo"] = seconds / photos
    if single is None:
        return row | {"peak_mb": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024}
    row["overhead_percent"] = 100 * (seconds / single["seconds"] - 1)
    return row | {"cpu_overhead_percent": 100 * (cpu / single["cpu_seconds"] - 1)}
