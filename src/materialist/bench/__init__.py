"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

from __future__ import annotations

import inspect
import math
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
        options[option] = _checked(option, value, str(parameters[option].annotation))
    folder = claim(Path(output), force=force)
    benchmark(data=None if data is None else Path(data), output=folder, **options)
    return folder


def _checked(option: str, value: Any, kind: str) -> Any:
    """The value as the benchmark takes it; `kind` is the annotation of its parameter, as in "int | None".

    Raises InputError where it is of another kind, not finite, or too small.
    """
    kinds, shown = set(kind.split(" | ")), value if isinstance(value, str | Path) else repr(value)
    if "None" in kinds and value is None:
        return value
    if isinstance(value, bool) != ("bool" in kinds):
        raise InputError(f"--{option} is {value!r}; give {'true or false' if 'bool' in kinds else 'a value'}.")
    if isinstance(value, bool):
        return value
    if isinstance(value, int | float) and not kinds & {"int", "float"}:
        return str(shown)  # a name that reads as a number
    number = isinstance(value, int | float) and math.isfinite(value)
    if not number and "str" not in kinds:
        raise InputError(f"--{option} is {value!r}; give a {'whole ' if 'int' in kinds else ''}number.")
    if number and "int" in kinds:
        if value != int(value) and "float" not in kinds:
            raise InputError(f"--{option} is {value!r}; give a whole number.")
        value = int(value) if value == int(value) else value
    least = 1 if option in AT_LEAST_ONE else 0
    if number and kinds <= {"int", "None"} and value < least:
        raise InputError(f"--{option} is {value}; give at least {least}.")
    return value
