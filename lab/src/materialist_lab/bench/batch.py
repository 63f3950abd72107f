"""`bench batch`: what many photos cost together, beside one after the other, by number of workers.

The same photos, run as a user runs them: first `materialist invert` on each, in a process of its own with one thread;
then `materialist batch` on all of them, with each number of workers (a thread each). Seconds are wall clock from start
to end, processor seconds those of all processes together, which other work on the machine hardly changes. The overhead
compares with the single inversions: negative where starting Python and compiling kernels once pays. The results must be
the same by hash, or the benchmark fails.
"""

import json
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from materialist.batches.photos import list_photos
from materialist.batches.results import package_hash
from materialist.batches.task import SINGLE_THREAD
from materialist.errors import MaterialistError
from materialist.option_kinds import option
from materialist_lab.bench.benchmark import (
    COUNT,
    SIZE,
    Benchmark,
    Row,
    materialist,
    numbers,
    spread,
)
from materialist_lab.bench.report import Column, Report

EXAMPLES = ("example:cat", "example:coffee", "example:rocket", "example:astronaut")
"""The photos without `data`."""


@dataclass(frozen=True, kw_only=True)
class BatchBench(Benchmark):
    """Invert the photos of `data` (those of data/photos where there is one), else the built-in examples.

    Raises MaterialistError where the ways give different results.
    """

    columns = (
        Column("seconds", "s", "lower", 1),
        Column("cpu_seconds", "processor s", "lower", 1),
        Column("seconds_per_photo", "s a photo", "lower", 2),
        Column("overhead_percent", "overhead, % of s", "lower", 1),
        Column("cpu_overhead_percent", "overhead, % of processor s", "lower", 1),
    )

    photos: int = option(4, "How many, spread over those there are.", **COUNT)
    size: int = option(128, "Longer side.", **SIZE)
    workers: str = option("1,2", "Numbers of workers, with commas.", kind="name")

    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        counts = numbers("workers", self.workers, 1, 1024)
        options = (
            "--size",
            str(self.size),
            "--seed",
            str(self.seed),
            "--device",
            self.device,
            "--json",
        )
        # --- Single inversions, a process each ---
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder)
            photos = chosen(data, self.photos, place)
            (place / "photos.txt").write_text("\n".join(photos) + "\n", "utf-8")
            begin = _usage()
            for k, photo in enumerate(photos):
                materialist(
                    "invert",
                    photo,
                    "-o",
                    str(place / f"{k}.scene"),
                    *options,
                    environment=SINGLE_THREAD,
                )
            single = _row("single inversions, one after the other", begin, len(photos))
            yield single
            hashes = {photo: package_hash(place / f"{k}.scene") for k, photo in enumerate(photos)}
            # --- The same photos as a batch ---
            for count in counts:
                begin = _usage()
                runs = place / f"runs-{count}"
                listed = (str(place / "photos.txt"), "-o", str(runs), "--workers", str(count))
                materialist("batch", *listed, *options, environment=SINGLE_THREAD)
                row = _row(f"batch, {count} worker{'s' if count > 1 else ''}", begin, len(photos))
                done = json.loads((runs / "summary.json").read_text("utf-8"))["rows"]
                # The same scenes bit for bit, or times cannot be compared.
                if {row["id"]: row["scene_hash"] for row in done} != hashes:
                    raise MaterialistError(
                        f"A batch with {count} workers gave other scenes than single inversions."
                    )
                over = {f"{name}overhead_percent": f"{name}seconds" for name in ("", "cpu_")}
                yield row | {
                    ours: 100 * (row[name] / single[name] - 1) for ours, name in over.items()
                }


def chosen(data: Path | None, photos: int, runs: Path) -> list[str]:
    """Photos as texts for the command line, spread over those there are; results go into `runs`."""
    if data is None:
        return list(EXAMPLES[:photos])
    below = data / "photos"
    locations = [
        photo.location for photo in list_photos(below if below.is_dir() else data, runs=runs)
    ]
    return spread(locations, photos)


def _usage() -> tuple[float, float]:
    """Wall clock, and processor seconds of all processes that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter(), children.ru_utime + children.ru_stime


def _row(method: str, begin: tuple[float, float], photos: int) -> Row:
    seconds, cpu = (after - before for after, before in zip(_usage(), begin, strict=True))
    row = {"method": method, "sample": "all", "seconds": seconds, "cpu_seconds": cpu}
    return row | {"seconds_per_photo": seconds / photos}
