"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from materialist.errors import InputError

BENCHMARKS = {
    "photo-alone": "PhotoAloneBench",
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
    """Run benchmark `name` and write report.json, report.md, plot.png and sheet.png into the folder `output`.

    `options` are the fields of the benchmark's class, as values or as texts. Returns the folder. Raises InputError
    for an unknown name or option, OutputError when `output` holds something and `force` is not given.
    """
    from materialist.bench.report import claim

    if name not in BENCHMARKS:
        raise InputError(f"There is no benchmark '{name}'; choose one of {', '.join(BENCHMARKS)}.")
    benchmark = benchmark_class(name).given(**options)
    folder = claim(Path(output), force=force)
    benchmark.run(None if data is None else Path(data), folder)
    return folder


def benchmark_class(name: str) -> Any:
    """The class of a benchmark, whose fields are its options."""
    return getattr(import_module(f"materialist.bench.{name.replace('-', '_')}"), BENCHMARKS[name])
