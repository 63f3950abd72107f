"""`materialist train matnet` and `materialist train export`: train the networks that predict materials."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import (
    CheckpointSeconds,
    Device,
    DeviceOption,
    Force,
    Json,
    Minutes,
    ResumeRun,
    Seed,
    Steps,
    output_option,
)
from materialist.cli.outcome import report_success


class Config(StrEnum):
    """Which network and recipe."""

    bundled = "bundled"
    paper = "paper"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("matnet")(train_maps)
    app.command("export")(export)


def train_maps(
    data: Annotated[
        list[Path],
        typer.Option(
            help="A set made by `materialist train data` (several: give it again), or an InteriorVerse folder."
        ),
    ],
    output: Annotated[Path, output_option("RUN", "Folder of the run.")],
    config: Annotated[Config, typer.Option(help="The network that ships, or the paper's.")] = Config.bundled,
    resume: ResumeRun = False,
    steps: Steps = None,
    minutes: Minutes = None,
    batch: Annotated[int | None, typer.Option(help="Pictures a step, on each device; default: the recipe's.")] = None,
    size: Annotated[
        int | None, typer.Option(help="Side of all crops, pixels; default: the recipe's, small ones first.")
    ] = None,
    rate: Annotated[float | None, typer.Option(help="Peak learning rate; default: the recipe's.")] = None,
    init: Annotated[
        Path | None,
        typer.Option(help="Weights to begin from; bundled: those of `train export`, paper: Depth Anything or DINOv2."),
    ] = None,
    every: CheckpointSeconds = 300,
    score_samples: Annotated[int, typer.Option(help="Samples kept aside that each checkpoint is scored on.")] = 12,
    workers: Annotated[int, typer.Option(help="Processes that load data, for each training process.")] = 1,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
) -> None:
    """Train a network; several GPUs: torchrun --nproc-per-node N -m materialist train matnet ..."""
    from materialist.cli.train_run import train_run
    from materialist.io.datasets import open_sources
    from materialist.train import bundled, matnet
    from materialist.train.schedule import Budget
    from materialist.train.trainer import RunOptions

    make, recipe = {
        Config.bundled: (bundled.BundledTask, bundled.RECIPE), Config.paper: (matnet.PaperTask, matnet.RECIPE)
    }[config]  # fmt: skip
    chosen = recipe.changed(batch=batch, side=size, rate=rate)
    train_run(
        "matnet", lambda begin, _: make(open_sources(data), chosen, init=begin, score_samples=score_samples), output,
        budget=Budget(steps, minutes), options=RunOptions(checkpoint_seconds=every, workers=workers, seed=seed),
        init=init, device=device.value, resume=resume, as_json=as_json,
    )  # fmt: skip


def export(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a run of `train matnet`.")],
    output: Annotated[Path, output_option("FILE", "A .safetensors file.")],
    average_with: Annotated[
        Path | None, typer.Option(help="Exported weights, such as the run began from: the mean of both is written.")
    ] = None,
    as_json: Json = False,
    force: Force = False,
) -> None:
    """Write the averaged weights of a run as float16 with everything needed to load them."""
    from materialist.train.export import export_run

    facts = export_run(run, output, average_with=average_with, force=force)
    lines = [f"{output}: {facts['megabytes']:.1f} MB after {facts['step']} steps."]
    report_success("train export", as_json, lines, output=str(output), **facts)
