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
from materialist.cli.outcome import report_success
from materialist.errors import Interrupted


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
    from materialist.cli.progress import StageProgress
    from materialist.train import checkpoint
    from materialist.train.budget import Budget
    from materialist.train.clicks.trainer import Recipe, Trainer
    from materialist.train.clicks.views import produce

    budget = Budget(steps=steps, minutes=40 if steps is None and minutes is None else minutes)
    recipe = Recipe(batch=batch, rate=rate, bfloat16=bfloat16)
    note = (lambda _: None) if as_json else lambda text: typer.echo(text, err=True)
    if init is not None and resume and checkpoint.there(output):
        note(f"--init is where a run begins; that in {output} goes on from its checkpoint.")
        init = None
    checkpoint.begun(output, Trainer.kind, resume=resume)  # views take long: refuse before they are made
    with StageProgress(quiet=as_json) as progress:
        produce(data, output / "views", progress)
        trainer = Trainer(
            output, output / "views", budget=budget, recipe=recipe, seed=seed, every=every, resume=resume, init=init,
            note=note, device=device.value,
        )  # fmt: skip
        figures = trainer.run(progress)
    if trainer.interrupted:
        raise Interrupted(f"Interrupted at step {trainer.clock.step}; go on with --resume.")
    lines = [f"{output / 'weights.safetensors'}: step {trainer.clock.step}."]
    report_success("train clicks", as_json, lines, run=str(output), step=trainer.clock.step, **figures)
