"""`materialist bench NAME`: one command for each benchmark, whose flags are the fields of its class."""

from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from materialist.cli.generate import add_command, group
from materialist.cli.options import Json, output_option
from materialist.cli.outcome import report_success
from materialist.errors import InputError
from materialist_lab import bench as benchmarks
from materialist_lab.bench import BENCHMARKS

ABOUT = "Run a benchmark and write its report; materialist bench NAME --help has its options."


class BenchmarkGroup(TyperGroup):
    """The benchmarks as commands. Their modules load torch and Mitsuba, so each is imported when it is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        return list(BENCHMARKS)

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        return command_of(cmd_name)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list in the help, by which no benchmark is imported."""
        with formatter.section("Benchmarks"):
            formatter.write_dl([(name, benchmarks.summary_of(name)) for name in BENCHMARKS])


def command_of(name: str) -> Any:
    """The parser's command that runs a benchmark, whose module it imports. Raises InputError for an unknown name."""

    def run(
        output: Annotated[Path, output_option("REPORT", "Folder for the report.")],
        benchmark: Any,
        data: Annotated[
            Path | None, typer.Option(help="Folder with meshes, HDR captures, photos.")
        ] = None,
        force: Annotated[
            bool, typer.Option("--force", help="Replace the report when it exists.")
        ] = False,
        as_json: Json = False,
    ) -> None:
        if data is not None and not data.is_dir():
            raise InputError(f"There is no data folder at {data}.")
        benchmarks.run_benchmark(benchmark, output=output, data=data, force=force)
        report_success("bench", as_json, [f"Look at {output}"], name=name, report=str(output))

    run.__annotations__["benchmark"] = benchmarks.benchmark_class(name)
    run.__doc__ = benchmarks.summary_of(name)
    single = group(name, "")
    add_command(single, run, name)
    return typer.main.get_command(single)


app = group("bench", ABOUT, cls=BenchmarkGroup)
