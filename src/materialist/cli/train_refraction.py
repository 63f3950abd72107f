"""`materialist train refraction`: make the views, and train the network that predicts how thick objects are."""

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
from materialist.cli.outcome import report_success


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("refraction")(refraction)


def refraction(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    data: Annotated[
        Path | None, typer.Option(help="Folder for the views, used again by later runs; default: RUN/views.")
    ] = None,
    data_only: Annotated[bool, typer.Option("--data-only", help="Make the views, do not train.")] = False,
    shapes: Annotated[int, typer.Option(help="Shapes to learn from.")] = 640,
    views: Annotated[int, typer.Option(help="Views of each.")] = 24,
    heldout: Annotated[int, typer.Option(help="Shapes kept aside for the figures.")] = 64,
    init: Annotated[Path | None, typer.Option(help="Weights of an earlier run to begin from.")] = None,
    steps: Steps = None,
    minutes: Minutes = None,
    batch: Batch = 32,
    rate: Rate = 2e-3,
    bfloat16: Bfloat16 = False,
    resume: ResumeRun = False,
    every: CheckpointSeconds = 180,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
) -> None:
    """Train RefractionNet on procedural shapes; RUN/weights.safetensors holds it, ready to use."""
    from materialist.procedural.thickness.dataset import ViewPlan, produce

    folder = data or output / "views"
    train, aside = folder / "train", folder / "heldout"
    plans = {aside: ViewPlan(heldout, min(views, 8), "heldout", seed), train: ViewPlan(shapes, views, "train", seed)}
    if data_only:
        from materialist.cli.progress import StageProgress

        with StageProgress(quiet=as_json) as progress:
            seconds = sum(produce(place, plan, progress) for place, plan in plans.items())
        lines = [f"{shapes} x {views} views in {train} ({seconds:.0f} s)"]
        report_success("train refraction", as_json, lines, data=str(folder), seconds=seconds)
        return
    from materialist.cli.train_run import train_run
    from materialist.predict.refraction.network import RefractionNet
    from materialist.train.refraction import RECIPE, RefractionTask
    from materialist.train.schedule import Budget
    from materialist.train.trainer import RunOptions

    recipe = RECIPE.changed(batch=batch, rate=rate, bfloat16=bfloat16)

    def task(begin, progress):
        if begin is not None:
            RefractionNet.load(begin)  # views take long: refuse other weights before they are made
        for place, plan in plans.items():
            produce(place, plan, progress)
        return RefractionTask(train, aside, recipe, init=begin)

    train_run(
        "refraction", task, output, budget=Budget(steps, 30 if steps is None and minutes is None else minutes),
        options=RunOptions(checkpoint_seconds=every, seed=seed), init=init, device=device.value, resume=resume,
        as_json=as_json,
    )  # fmt: skip
