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
from materialist.errors import Interrupted


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
    from materialist.cli.progress import StageProgress
    from materialist.procedural.thickness.dataset import Plan, produce

    note = (lambda _: None) if as_json else lambda text: typer.echo(text, err=True)
    folder = data or output / "views"
    train, aside = folder / "train", folder / "heldout"
    plans = Plan(shapes, views, "train", seed), Plan(heldout, min(views, 8), "heldout", seed)
    if not data_only:
        from materialist.predict.refraction.network import RefractionNet
        from materialist.train import checkpoint
        from materialist.train.budget import Budget
        from materialist.train.refraction.trainer import Recipe, Trainer

        budget = Budget(steps=steps, minutes=30 if steps is None and minutes is None else minutes)
        recipe = Recipe(batch=batch, rate=rate, bfloat16=bfloat16)
        checkpoint.begun(output, Trainer.kind, resume=resume)  # views take long: refuse before they are made
        if init is not None and resume and checkpoint.there(output):
            note(f"--init is where a run begins; that in {output} goes on from its checkpoint.")
            init = None
        elif init is not None:
            RefractionNet.load(init)
    with StageProgress(quiet=as_json) as progress:
        seconds = sum(produce(place, plan, progress) for place, plan in zip((aside, train), plans[::-1], strict=True))
        if data_only:
            lines = [f"{shapes} x {views} views in {train} ({seconds:.0f} s)"]
            report_success("train refraction", as_json, lines, data=str(folder), seconds=seconds)
            return
        trainer = Trainer(
            output, train, aside, budget=budget, recipe=recipe, seed=seed, every=every, resume=resume,
            note=note, device=device.value, init=init,
        )  # fmt: skip
        figures = trainer.run(progress)
    if trainer.interrupted:
        raise Interrupted(f"Interrupted at step {trainer.clock.step}; go on with --resume.")
    lines = [f"{output / 'weights.safetensors'}: step {trainer.clock.step}."]
    report_success("train refraction", as_json, lines, run=str(output), step=trainer.clock.step, **figures)
