"""What every benchmark has: options as the fields of a frozen dataclass, rows, lists of names, times, commands."""

import inspect
import os
import subprocess
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from rich.console import Console
from rich.progress import track

from materialist.errors import InputError, MaterialistError
from materialist.option_kinds import OperationOptions, option
from materialist.render.variant import setup
from materialist_lab.bench.report import Column, Report, write

Row = dict[str, Any]
"""'method', 'sample' and the keys of columns; a figure that does not apply is absent."""
COUNT: dict[str, Any] = {"kind": "whole", "low": 1, "high": 10**6}
COUNT_OR_0: dict[str, Any] = COUNT | {"low": 0}
SIZE: dict[str, Any] = {"kind": "whole", "low": 16, "high": 8192, "unit": "pixels"}


@dataclass(frozen=True, kw_only=True)
class Benchmark(OperationOptions, ABC):
    """One benchmark; its fields are the options of `materialist bench NAME`.

    The docstring of its module is the report's title (the first line) and the text above the table.
    """

    operation = "The benchmark"
    columns: ClassVar[tuple[Column, ...]]
    write_every: ClassVar[float] = 20.0
    """Seconds after which a growing report is written again."""

    seed: int = option(0, "Same seed, same result.", kind="whole", low=0, high=2**31 - 1)
    device: str = option("auto", "Where it runs.", kind="word", choices=("auto", "cpu", "cuda"))

    @abstractmethod
    def rows(self, data: Path | None, report: Report) -> Iterator[Row]:
        """Measure with the files of `data`; may add to the report's settings and sheet. Raises InputError."""

    def run(self, data: Path | None, output: Path) -> None:
        """Write the report into the folder `output`, as rows come in and when the run ends or is stopped.

        Raises InputError where there are no rows.
        """
        setup(self.device)
        # --- The empty report: its text is the module's docstring ---
        title, _, note = inspect.cleandoc(
            sys.modules[type(self).__module__].__doc__ or ""
        ).partition("\n\n")
        settings = {name: None if value == "" else value for name, value in asdict(self).items()}
        settings["data"] = None if data is None else data.name
        report = Report(title, note, settings, self.columns)
        # --- Rows as they come in; written at once, then every few seconds ---
        written = -self.write_every
        try:
            for row in track(
                self.rows(data, report), "benchmark", total=None, console=Console(stderr=True)
            ):
                report.rows.append(row)
                if time.monotonic() > written + self.write_every:
                    write(report, output)
                    written = time.monotonic()
        # A stopped run keeps what it measured.
        finally:
            if report.rows:
                write(report, output)
        if not report.rows:
            raise InputError("There is nothing to measure with these options.")


def names(called: str, text: str, known: Collection[str] = ()) -> list[str]:
    """The names of a list with commas, each once. Raises InputError for none, or for one that is not `known`."""
    # A dict keeps the order and drops repetitions.
    chosen = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if not chosen:
        raise InputError(f"The {called} is empty; name at least one.")
    for name in chosen if known else ():
        if name not in known:
            raise InputError(f"The {called} '{name}' is unknown; choose from {', '.join(known)}.")
    return chosen


def numbers(called: str, text: str, low: float, high: float, kind: type = int) -> list[Any]:
    """The numbers of a list with commas. Raises InputError for anything but numbers from `low` to `high`."""
    try:
        values = [kind(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not all(low <= number <= high for number in values) or not values:
        raise InputError(
            f"The {called} is {text!r}; give numbers from {low} to {high} with commas."
        )
    return values


def materialist(*arguments: str, environment: Mapping[str, str] | None = None) -> None:
    """Run `materialist` with more in its environment; raises MaterialistError with its last lines when it fails."""
    command = [sys.executable, "-m", "materialist", *arguments]
    done = subprocess.run(
        command, capture_output=True, text=True, env={**os.environ, **(environment or {})}
    )
    if done.returncode:
        # A process that the kernel kills for memory says nothing.
        said = (
            f"{done.stdout[-300:]}{done.stderr[-300:]}".strip()
            or "nothing; it may have run out of memory"
        )
        raise MaterialistError(
            f"materialist {' '.join(arguments)} ended with code {done.returncode}: {said}"
        )


def timed(work: Callable[..., Any], *args: Any, **kwargs: Any) -> tuple[Any, dict[str, float]]:
    """What `work` returns, its wall seconds, and processor seconds with those of processes that it started and ended.

    Other programs hardly change the latter.
    """

    # Children count once they ended, which is what `os.times` has.
    def spent() -> tuple[float, float]:
        return time.perf_counter(), time.process_time() + sum(os.times()[2:4])

    begun = spent()
    value = work(*args, **kwargs)
    wall, cpu = (end - start for start, end in zip(begun, spent(), strict=True))
    return value, {"seconds": wall, "cpu_seconds": cpu}


def spread(things: list, limit: int) -> list:
    """At most `limit` of them (0: all), evenly spread."""
    if not limit or limit >= len(things):
        return things
    return [things[round(k * (len(things) - 1) / max(limit - 1, 1))] for k in range(limit)]
