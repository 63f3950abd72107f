"""`materialist train clicks`: train the network that finds the object at a click."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import (
    Batch,
    Bfloat16,
    CheckpointSeconds,
    Device,
    DeviceOption,
    Json,
    Minutes,
    Rate,
    ResumeRun,
    Seed,
    Steps,
    output_option,
)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("clicks")(clicks)


def clicks(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    data: Annotated[Path, typer.Option(metavar="SET", help="A data set of: materialist train data.")],
    steps: Steps = None,
    minutes: Minutes = None,
    batch: Batch = 16,
    rate: Rate = 1.5e-3,
    bfloat16: Bfloat16 = False,
    init: Annotated[Path | None, typer.Option(help="Weights of an earlier run to begin from.")] = None,
    resume: ResumeRun = False,
    every: CheckpointSeconds = 180,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
) -> None:
    """Train ClickNet on procedural pictures as the bundled network sees them; RUN/weights.safetensors holds it."""
    from materialist.cli.train_run import train_run
    from materialist.train.click_views import produce
    from materialist.train.clicks import RECIPE, ClickTask
    from materialist.train.schedule import Budget
    from materialist.train.trainer import RunOptions

    recipe = RECIPE.changed(batch=batch, rate=rate, bfloat16=bfloat16)

    def task(begin, progress):
        produce(data, output / "views", progress)
        return ClickTask(output / "views", recipe, init=begin)

    train_run(
        "clicks", task, output, budget=Budget(steps, 40 if steps is None and minutes is None else minutes),
        options=RunOptions(checkpoint_seconds=every, seed=seed), init=init, device=device.value, resume=resume,
        as_json=as_json,
    )  # fmt: skip
