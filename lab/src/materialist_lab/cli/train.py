"""`materialist train ...`: the sub-commands that make training data and train networks."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from materialist.cli.generate import add_command, group
from materialist.cli.options import Computing, output_option
from materialist.cli.outcome import report_success
from materialist.cli.progress import stage_progress
from materialist.errors import Interrupted
from materialist.option_kinds import OperationOptions, option
from materialist_lab.cli.options import Learning, Training
from materialist_lab.procedural.options import DataSetOptions

if TYPE_CHECKING:
    from materialist.types import Progress

SETS = (
    "A set made by `materialist train data` (several: give it again), or an InteriorVerse folder."
)


@dataclass(frozen=True, kw_only=True)
class MapsLearning(Learning):
    config: str = option(
        "bundled",
        "The network that ships, or the paper's.",
        kind="word",
        choices=("bundled", "paper"),
    )


@dataclass(frozen=True, kw_only=True)
class Views(OperationOptions):
    """The views that RefractionNet learns from."""

    data: Path | None = option(
        None, "Folder for the views, used again by later runs; default: RUN/views.", kind="file"
    )
    shapes: int = option(640, "Shapes to learn from.", kind="whole", low=1)
    views: int = option(24, "Views of each.", kind="whole", low=1)
    heldout: int = option(64, "Shapes kept aside for the figures.", kind="whole", low=1)


def data(
    output: Annotated[Path, output_option("DIR", "Folder of the data set.")],
    options: DataSetOptions,
    computing: Computing,
    count: Annotated[int, typer.Option(help="Samples the set should hold.")] = 1000,
    workers: Annotated[int, typer.Option(help="Processes that render.")] = 1,
    resume: Annotated[
        bool, typer.Option("--resume", help="Make the missing samples of a set begun before.")
    ] = False,
    sheet: Annotated[
        Path | None,
        typer.Option(metavar="PNG", help="Only draw a contact sheet of the set in DIR."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="With --sheet: replace PNG when it exists.")
    ] = False,
) -> None:
    """Render a seeded, labelled data set; sample i is the same whatever the count and the workers."""
    # --- Only the sheet of a set that is there ---
    if sheet is not None:
        from materialist.io.image import ensure_image_writable
        from materialist_lab.procedural.dataset import write_data_sheet

        ensure_image_writable(sheet, force=force)
        shown = write_data_sheet(output, sheet, seed=computing.seed)
        report_success(
            "train data", computing.as_json, [f"Look at {sheet}"], sheet=str(sheet), samples=shown
        )
        return
    from materialist.io.atomic import require_parent
    from materialist_lab.procedural.dataset import produce

    require_parent(output)
    start = time.monotonic()
    with stage_progress(quiet=computing.as_json) as progress:
        rendered = produce(
            output, options, count=count, workers=workers, resume=resume, progress=progress
        )
    facts = {
        "output": str(output),
        "rendered": rendered,
        "existing": count - rendered,
        "seconds": time.monotonic() - start,
    }
    lines = [f"{count} samples in {output} ({rendered} new, {facts['seconds']:.0f} s)"]
    report_success("train data", computing.as_json, lines, **facts)


def matnet(
    data: Annotated[list[Path], typer.Option(help=SETS)],
    output: Annotated[Path, output_option("RUN", "Folder of the run.")],
    learning: MapsLearning,
    training: Training = Training(every=300),  # noqa: B008
    score_samples: Annotated[
        int, typer.Option(help="Samples kept aside that each checkpoint is scored on.")
    ] = 12,
    workers: Annotated[int, typer.Option(help="Processes that load data.")] = 1,
) -> None:
    """Train a network of all maps; RUN/weights.safetensors holds it, ready to use."""
    from materialist_lab.data.datasets import open_sources
    from materialist_lab.train import bundled
    from materialist_lab.train import matnet as paper

    # Imported here: torch takes seconds, and `--help` must not wait for it.
    make: Any
    make, base = {
        "bundled": (bundled.BundledTask, bundled.RECIPE),
        "paper": (paper.PaperTask, paper.RECIPE),
    }[learning.config]
    recipe = learning.recipe(base)

    def task(begin, _):
        return make(open_sources(data), recipe, init=begin, score_samples=score_samples)

    _train("matnet", task, output, training, init=learning.init, workers=workers)


def refraction(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    views: Views,
    training: Training,
    learning: Learning,
) -> None:
    """Train RefractionNet on procedural shapes; RUN/weights.safetensors holds it, ready to use."""
    from materialist.predict.refraction.network import RefractionNet
    from materialist_lab.procedural.thickness.dataset import ViewPlan, produce
    from materialist_lab.train.refraction import RECIPE, RefractionTask

    # Views elsewhere can serve several runs.
    folder = views.data or output / "views"
    lessons = folder / "train"
    aside = folder / "heldout"
    # Few views of each held-out shape suffice for figures.
    plans = {
        aside: ViewPlan(views.heldout, min(views.views, 8), "heldout", training.seed),
        lessons: ViewPlan(views.shapes, views.views, "train", training.seed),
    }
    recipe = learning.recipe(RECIPE)

    def task(begin: Path | None, progress: Progress) -> Any:
        if begin is not None:
            RefractionNet.load(begin)  # views take long: refuse other weights before they are made
        for place, plan in plans.items():
            produce(place, plan, progress)
        return RefractionTask(lessons, aside, recipe, init=begin)

    _train("refraction", task, output, training, init=learning.init, minutes=30)


def clicks(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    data: Annotated[
        Path, typer.Option(metavar="SET", help="A data set of: materialist train data.")
    ],
    training: Training,
    learning: Learning,
    cutouts: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Folder of .png and .webp things cut out, to be pasted in."
        ),
    ] = None,
) -> None:
    """Train ClickNet on procedural pictures as the bundled network sees them; RUN/weights.safetensors holds it."""
    from materialist_lab.train.clicks import RECIPE, ClickTask, produce_views

    recipe = learning.recipe(RECIPE)

    def task(begin: Path | None, progress: Progress) -> Any:
        produce_views(data, output / "views", cutouts, progress)
        return ClickTask(output / "views", recipe, init=begin)

    _train("clicks", task, output, training, init=learning.init, minutes=40)


def _train(
    kind: str,
    make_task: Callable[[Path | None, Progress], Any],
    output: Path,
    training: Training,
    *,
    init: Path | None,
    minutes: float | None = None,
    workers: int = 0,
) -> None:
    """Train the task that `make_task` makes of (weights to begin from, progress), in the folder `output`.

    `minutes` are those of a run that names neither steps nor minutes. Errors that make a run impossible are raised
    before `make_task` is called, which may take long.
    """
    from materialist.io.atomic import require_parent
    from materialist.predict.protocol import on_gpu
    from materialist_lab.train import checkpoint
    from materialist_lab.train.schedule import Budget
    from materialist_lab.train.trainer import RunOptions, Trainer

    # --- How long, where, and what is said ---
    unlimited = training.steps is None and training.minutes is None
    budget = Budget(training.steps, minutes if unlimited else training.minutes)
    options = RunOptions(checkpoint_seconds=training.every, workers=workers, seed=training.seed)
    device = "cuda" if on_gpu(training.device) else "cpu"
    note = (lambda _: None) if training.as_json else lambda text: typer.echo(text, err=True)
    # --- Refusals come before anything slow ---
    require_parent(output)
    checkpoint.load(output, kind, resume=training.resume)
    # --- The run ---
    with stage_progress(quiet=training.as_json) as progress:
        trainer = Trainer(
            make_task(init, progress),
            output,
            budget=budget,
            options=options,
            device=device,
            resume=training.resume,
            note=note,
        )
        scores = trainer.fit(progress)
    # --- What came of it ---
    step = trainer.schedule.step
    sheet = output / "sheet.png"
    if trainer.interrupted:
        raise Interrupted(f"Interrupted at step {step}; the same command with --resume goes on.")
    lines = [
        f"{output / checkpoint.WEIGHTS}: step {step}.",
        *([f"Look at {sheet}"] if sheet.is_file() else []),
    ]
    if "of" in scores:
        lines.insert(1, f"The figures are of {scores['of']}.")
    facts = {"run": str(output), "step": step, "scored_on": scores.pop("of", None)}
    report_success(f"train {kind}", training.as_json, lines, **facts, **scores)


def mean(
    first: Annotated[Path, typer.Argument(metavar="FIRST", help="Weights before a run.")],
    second: Annotated[Path, typer.Argument(metavar="SECOND", help="Weights after it.")],
    output: Annotated[Path, output_option("FILE", "The mean, as .safetensors.")],
    share: Annotated[float, typer.Option(metavar="S", help="Of SECOND, 0 to 1.")] = 0.5,
) -> None:
    """Average two weights of the bundled network: what a short run has learnt, without what it has forgotten."""
    from materialist_lab.train.mean import write_mean

    write_mean(first, second, output, share)
    report_success("train mean", False, [f"{output}: {share:g} of {second}, the rest of {first}."])


app = group("train", "Make training data, and train the networks that predict materials.")
for command in (data, matnet, refraction, clicks, mean):
    add_command(app, command)
