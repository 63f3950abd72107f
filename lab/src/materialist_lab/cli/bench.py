"""`materialist bench NAME`: dispatch to materialist.bench, with whatever options that benchmark takes."""

from pathlib import Path
from typing import Annotated, Any

import typer

from materialist import bench as benchmarks
from materialist.bench import BENCHMARKS
from materialist.cli.options import Run, output_option
from materialist.cli.outcome import report_success
from materialist.errors import InputError


def bench(
    context: typer.Context,
    name: Annotated[str, typer.Argument(metavar="NAME", help=f"{', '.join(BENCHMARKS)}.")],
    output: Annotated[Path, output_option("REPORT", "Folder for the report.")],
    run: Run,
    data: Annotated[
        Path | None, typer.Option(help="Folder with meshes, HDR captures, photos.")
    ] = None,
) -> None:
    """Run a benchmark. Its own options follow the name, as --scenes 10 or scenes=10."""
    options = parse_extra(context.args)
    if data is not None and not data.is_dir():
        raise InputError(f"There is no data folder at {data}.")
    how: dict[str, Any] = {"seed": run.seed, "device": run.device, "force": run.force}
    benchmarks.run(name, data=data, output=output, **how | options)
    report_success("bench", run.as_json, [f"Look at {output}"], name=name, report=str(output))


def parse_extra(arguments: list[str]) -> dict[str, str | bool]:
    """`--scenes 10 --quick size=256` as {"scenes": "10", "quick": True, "size": "256"}. Raises InputError."""
    options: dict[str, str | bool] = {}
    waiting: str | None = None
    for argument in arguments:
        name, equals, value = argument.partition("=")
        key = name.removeprefix("--").replace("-", "_")
        if key.isidentifier() and (argument.startswith("--") or equals):
            options[key] = value if equals else True
            waiting = None if equals else key
        elif waiting is not None:
            options[waiting], waiting = argument, None
        else:
            raise InputError(f"{argument!r} is not an option; write --name value or name=value.")
    return options
