"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

from __future__ import annotations

import math
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import Any

from materialist.errors import InputError

BENCHMARKS = {
    "invert": "InvertBench",
    "beside": "BesideBench",
    "batch": "BatchBench",
    "light": "LightBench",
    "ablation": "AblationBench",
    "materials": "MaterialsBench",
    "whdr": "WhdrBench",
    "predictor": "PredictorBench",
    "thickness": "ThicknessBench",
    "select": "SelectBench",
    "glass": "GlassBench",
    "edit": "EditBench",
    "studio": "StudioBench",
}
"""Name -> the class in the module of that name."""


def run(name: str, *, output: str | Path, data: str | Path | None = None, force: bool = False, **options: Any) -> Path:
    """Run benchmark `name` and write report.json, report.md and plot.png into the folder `output`.

    `options` are the fields of the benchmark's class. Returns the folder. Raises InputError
    for an unknown name or option, OutputError when `output` holds something and `force` is not given.
    """
    from materialist.bench.report import claim

    if name not in BENCHMARKS:
        raise InputError(f"There is no benchmark '{name}'; choose one of {', '.join(BENCHMARKS)}.")
    benchmark = getattr(import_module(f"materialist.bench.{name}"), BENCHMARKS[name])
    kinds = {field.name: str(field.type) for field in fields(benchmark)}
    for option, value in options.items():
        if option not in kinds:
            raise InputError(f"Benchmark '{name}' has no option '{option}'; it takes {', '.join(kinds)}.")
        options[option] = _checked(option, value, kinds[option])
    chosen = benchmark(**options)
    folder = claim(Path(output), force=force)
    chosen.run(None if data is None else Path(data), folder)
    return folder


def _checked(option: str, value: Any, kind: str) -> Any:
    """The value as the benchmark takes it; `kind` is the annotation of its parameter, as in "int | None".

    Raises InputError where it is of another kind or not finite.
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
    return value
