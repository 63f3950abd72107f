"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

from importlib import import_module
from pathlib import Path
from typing import Any

from materialist.errors import InputError

BENCHMARKS = (
    "real",
    "geometry",
    "photo-alone",
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
    "plate",
    "studio",
    "paper",
    "gpu",
    "export",
)
"""Names of modules, and of the classes in them: `photo-alone` is PhotoAloneBench."""


def run(
    name: str,
    *,
    output: str | Path,
    data: str | Path | None = None,
    force: bool = False,
    **options: Any,
) -> Path:
    """Run benchmark `name` and write report.json, report.md, plot.png and sheet.png into the folder `output`.

    `options` are the fields of the benchmark's class, as values or as texts. Returns the folder. Raises InputError
    for an unknown name or option, OutputError when `output` holds something and `force` is not given.
    """
    from materialist.bench.report import claim

    if name not in BENCHMARKS:
        raise InputError(f"There is no benchmark '{name}'; choose one of {', '.join(BENCHMARKS)}.")
    benchmark = benchmark_class(name).given(**options)
    folder = claim(Path(output), force=force or getattr(benchmark, "resume", False))
    benchmark.run(None if data is None else Path(data), folder)
    return folder


def benchmark_class(name: str) -> Any:
    """The class of a benchmark, whose fields are its options."""
    words = name.split("-")
    module = import_module(f"materialist.bench.{'_'.join(words)}")
    return getattr(module, "".join(word.capitalize() for word in words) + "Bench")
