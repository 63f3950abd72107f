"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

from __future__ import annotations

import inspect
from importlib import import_module
from pathlib import Path
from typing import Any

from materialist.errors import InputError

BENCHMARKS = (
    "invert",
    "batch",
    "light",
    "ablation",
    "materials",
    "whdr",
    "predictor",
    "thickness",
    "select",
    "glass",
    "edit",
    "studio",
)


AT_LEAST_ONE = ("spp", "truth_spp", "reference", "size", "views", "lights", "runs")
"""Options of which 0 means nothing; 0 of others leaves a part of the benchmark out."""


def run(name: str, *, output: str | Path, data: str | Path | None = None, force: bool = False, **options: Any) -> Path:
    """Run benchmark `name` and write report.json, report.md and plot.png into the folder `output`.

    `options` are those of the benchmark's own `run` (materialist.bench.NAME). Returns the folder. Raises InputError
    for an unknown name or option, OutputError when `output` holds something and `force` is not given.
    """
    from materialist.bench.report import claim

    if name not in BENCHMARKS:
        raise InputError(f"There is no benchmark '{name}'; choose one of {', '.join(BENCHMARKS)}.")
    benchmark = import_module(f"materialist.bench.{name}").run
    parameters = inspect.signature(benchmark).parameters
    known = [p for p in parameters if p not in ("data", "output")]
    for option, value in options.items():
        if option not in known:
            raise InputError(f"Benchmark '{name}' has no option '{option}'; it takes {', '.join(known)}.")
        _check(option, value, parameters[option].default)
    folder = claim(Path(output), force=force)
    benchmark(data=None if data is None else Path(data), output=folder, **options)
    return folder


def _check(option: str, value: Any, usual: Any) -> None:
    """Raises InputError where an option is no number, or no yes or no, and its usual value is one."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if isinstance(usual, bool) and not isinstance(value, bool):
        raise InputError(f"--{option} is {value!r}; give true or false.")
    if isinstance(usual, int) and not isinstance(usual, bool) and not (number and value == int(value)):
        raise InputError(f"--{option} is {value!r}; give a whole number.")
    least = 1 if option in AT_LEAST_ONE else 0
    if isinstance(usual, int) and not isinstance(usual, bool) and value < least:
        raise InputError(f"--{option} is {value}; give at least {least}.")
    if isinstance(usual, float) and not number:
        raise InputError(f"--{option} is {value!r}; give a number.")
