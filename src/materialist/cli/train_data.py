"""`materialist train data`: procedural, labelled renderings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.generate import add_command
from materialist.cli.options import Computing, output_option
from materialist.cli.outcome import report_success
from materialist.procedural.options import DataSetOptions


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, data)


def data(
    output: Annotated[Path, output_option("DIR", "Folder of the data set.")],
    wanted: DataSetOptions,
    computing: Computing,
    count: Annotated[int, typer.Option(help="Samples the set should hold.")] = 1000,
    workers: Annotated[int, typer.Option(help="Processes that render.")] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Make the missing samples of a set begun before.")] = False,
    sheet: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Only draw a contact sheet of the set in DIR.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="With --sheet: replace PNG when it exists.")] = False,
) -> None:
    """Render a seeded, labelled data set; sample i is the same whatever the count and the workers."""
    if sheet is not None:
        from materialist.io.image import ensure_image_writable
        from materialist.procedural.dataset import write_data_sheet

        ensure_image_writable(sheet, force=force)
        shown = write_data_sheet(output, sheet, seed=computing.seed)
        report_success("train data", computing.as_json, [f"Look at {sheet}"], sheet=str(sheet), samples=shown)
        return
    from materialist.cli.progress import StageProgress
    from materialist.procedural.dataset import produce

    with StageProgress(quiet=computing.as_json) as progress:
        made = produce(output, wanted, count=count, workers=workers, resume=resume, progress=progress)
    lines = [f"{made.existing + made.rendered} samples in {output} ({made.rendered} new, {made.seconds:.0f} s)"]
    report_success(
        "train data", computing.as_json, lines, output=str(output), rendered=made.rendered, existing=made.existing,
        seconds=made.seconds,
    )  # fmt: skip
