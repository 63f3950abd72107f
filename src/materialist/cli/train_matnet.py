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
from materialist.errors import Interrupted


class Config(StrEnum):
    """Which network and recipe."""

    bundled = "bundled"
    paper = "paper"


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.command("matnet")(matnet)
    app.command("export")(export)


def matnet(
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
    from materialist.train.budget import Budget
    from materialist.train.recipes import recipe

    budget = Budget(steps=steps, minutes=minutes)
    chosen = recipe(config.value, batch=batch, size=size, rate=rate)
    from materialist.cli.progress import StageProgress
    from materialist.io.datasets import open_sources
    from materialist.train import checkpoint
    from materialist.train.launch import join
    from materialist.train.tasks import task
    from materialist.train.trainer import Habits, Trainer

    processes = join(device.value)
    quiet = as_json or not processes.first
    note = (lambda _: None) if quiet else lambda text: typer.echo(text, err=True)
    if init is not None and resume and checkpoint.there(output):
        note(f"--init is where a run begins; that in {output} goes on from its checkpoint.")
        init = None
    habits = Habits(checkpoint_seconds=every, score_samples=score_samples, workers=workers, seed=seed)
    try:
        with StageProgress(quiet=quiet) as progress:
            trainer = Trainer(
                chosen, task(chosen, {"init": init} if init else None), open_sources(data), output,
                budget=budget, habits=habits, processes=processes, resume=resume,
                note=note,
            )  # fmt: skip
            figures = trainer.run(progress)
    finally:
        processes.leave()
    if processes.first:
        if trainer.interrupted:
            raise Interrupted(f"Interrupted at step {trainer.clock.step}; go on with --resume.")
        sheet = output / "sheet.png"
        lines = [f"{output}: step {trainer.clock.step}.", *([f"Look at {sheet}"] if sheet.is_file() else [])]
        if trainer.scored_on:
            lines.insert(1, f"The figures are of {trainer.scored_on}.")
        facts = {"run": str(output), "step": trainer.clock.step, "scored_on": trainer.scored_on or None}
        report_success("train matnet", as_json, lines, **facts, **figures)


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
