"""`materialist train data`: procedural, labelled renderings."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.generate import add_command
from materialist.cli.options import Device, DeviceOption, Json, Seed, output_option
from materialist.cli.outcome import report_success


class Split(StrEnum):
    """Which half of the captured meshes and HDR maps a data set may use."""

    train = "train"
    heldout = "heldout"


@dataclass(frozen=True)
class DataSet:
    """What a data set holds."""

    count: Annotated[int, typer.Option(help="Samples the set should hold.")] = 1000
    size: Annotated[int, typer.Option(help="Pixels on a side.")] = 256
    workers: Annotated[int, typer.Option(help="Processes that render.")] = 1
    spp: Annotated[int, typer.Option(help="Samples per pixel, before denoising.")] = 16
    meshes: Annotated[Path | None, typer.Option(help="Folder of .ply meshes to use as well.")] = None
    envmaps: Annotated[Path | None, typer.Option(help="Folder of .exr HDR captures to use as well.")] = None
    split: Annotated[Split, typer.Option(help="heldout uses only the files kept aside for testing.")] = Split.train
    only: Annotated[str, typer.Option(metavar="KIND", help="Only room, table, still-life or outdoor scenes.")] = ""
    resume: Annotated[bool, typer.Option("--resume", help="Make the missing samples of a set begun before.")] = False


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, data)


def data(
    output: Annotated[Path, output_option("DIR", "Folder of the data set.")],
    wanted: DataSet,
    sheet: Annotated[
        Path | None, typer.Option(metavar="PNG", help="Only draw a contact sheet of the set in DIR.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="With --sheet: replace PNG when it exists.")] = False,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
) -> None:
    """Render a seeded, labelled data set; sample i is the same whatever the count and the workers."""
    if sheet is not None:
        from materialist.io.image import ensure_image_writable
        from materialist.procedural.dataset import write_data_sheet

        ensure_image_writable(sheet, force=force)
        shown = write_data_sheet(output, sheet, seed=seed)
        report_success("train data", as_json, [f"Look at {sheet}"], sheet=str(sheet), samples=shown)
        return
    from materialist.cli.progress import StageProgress
    from materialist.procedural.dataset import produce
    from materialist.procedural.sample import Options

    options = Options(
        size=wanted.size, seed=seed, spp=wanted.spp, split=wanted.split, meshes=wanted.meshes, envmaps=wanted.envmaps,
        device=device, only=wanted.only,
    )  # fmt: skip
    with StageProgress(quiet=as_json) as progress:
        made = produce(
            output, options, count=wanted.count, workers=wanted.workers, resume=wanted.resume, progress=progress
        )
    lines = [f"{made.existing + made.rendered} samples in {output} ({made.rendered} new, {made.seconds:.0f} s)"]
    report_success(
        "train data", as_json, lines, output=str(output), rendered=made.rendered, existing=made.existing,
        seconds=made.seconds,
    )  # fmt: skip
