"""`materialist train data`: procedural, labelled renderings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.generate import add_command
from materialist.cli.options import Computing, output_option
from materialist.cli.outcome import report_success
from materialist.option_kinds import OperationOptions, option

# fmt: off


@dataclass(frozen=True, kw_only=True)
class DataSet(OperationOptions):
    """What a data set holds."""

    count: int = option(1000, "Samples the set should hold.", kind="whole")
    size: int = option(256, "Pixels on a side.", kind="whole")
    workers: int = option(1, "Processes that render.", kind="whole")
    spp: int = option(16, "Samples per pixel, before denoising.", kind="whole")
    meshes: Path | None = option(None, "Folder of .ply meshes to use as well.", kind="file")
    envmaps: Path | None = option(None, "Folder of .exr HDR captures to use as well.", kind="file")
    split: str = option(
        "train", "heldout uses only the files kept aside for testing.", kind="word", choices=("train", "heldout"))
    only: str = option(
        "", "Only room, table, still-life or outdoor scenes.", kind="name", metavar="KIND")
    resume: bool = option(False, "Make the missing samples of a set begun before.", kind="switch")


# fmt: on


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, data)


def data(
    output: Annotated[Path, output_option("DIR", "Folder of the data set.")],
    wanted: DataSet,
    computing: Computing,
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
    from materialist.procedural.sample import Options

    options = Options(
        size=wanted.size, seed=computing.seed, spp=wanted.spp, split=wanted.split, meshes=wanted.meshes,
        envmaps=wanted.envmaps, device=computing.device, only=wanted.only,
    )  # fmt: skip
    with StageProgress(quiet=computing.as_json) as progress:
        made = produce(
            output, options, count=wanted.count, workers=wanted.workers, resume=wanted.resume, progress=progress
        )
    lines = [f"{made.existing + made.rendered} samples in {output} ({made.rendered} new, {made.seconds:.0f} s)"]
    report_success(
        "train data", computing.as_json, lines, output=str(output), rendered=made.rendered, existing=made.existing,
        seconds=made.seconds,
    )  # fmt: skip
