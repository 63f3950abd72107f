"""Benchmarks: each measures the project with numbers that a reader can repeat, and writes a report folder."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from materialist.errors import InputError, MaterialistError

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
    """Run benchmark `name` and write report.json, report.md and sheet.png into the folder `output`.

    `options` are the fields of the benchmark's class, as values or as texts. Returns the folder. Raises InputError
    for an unknown name or option, OutputError when `output` holds something and `force` is not given.
    """
    benchmark = benchmark_class(name).merged(**options)
    return run_benchmark(benchmark, output=output, data=data, force=force)


def run_benchmark(
    benchmark: Any, *, output: str | Path, data: str | Path | None = None, force: bool = False
) -> Path:
    """As `run`, of a benchmark that has its options."""
    from materialist_lab.bench.report import claim

    was_there = Path(output).exists()
    folder = claim(Path(output), force=force or getattr(benchmark, "resume", False))
    try:
        benchmark.run(None if data is None else Path(data), folder)
    except MaterialistError:
        # A run that could not begin leaves no empty folder.
        if not was_there and not any(folder.iterdir()):
            folder.rmdir()
        raise
    return folder


def benchmark_class(name: str) -> Any:
    """The class of a benchmark, whose fields are its options. Raises InputError for an unknown name."""
    module = import_module(module_name(name))
    return getattr(module, "".join(word.capitalize() for word in name.split("-")) + "Bench")


def module_name(name: str) -> str:
    """The full name of the module of a benchmark. Raises InputError for an unknown name."""
    if name not in BENCHMARKS:
        raise InputError(f"There is no benchmark '{name}'; choose one of {', '.join(BENCHMARKS)}.")
    return f"{__name__}.{name.replace('-', '_')}"


def summary_of(name: str) -> str:
    """What a benchmark measures, in a sentence: the first line of its module, which is read but not imported."""
    spec = find_spec(module_name(name))
    assert spec is not None and spec.origin is not None
    text = ast.get_docstring(ast.parse(Path(spec.origin).read_text("utf-8"))) or ""
    sentence = text.partition("\n")[0].partition(": ")[2]
    return sentence[:1].upper() + sentence[1:]
