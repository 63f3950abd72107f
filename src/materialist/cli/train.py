"""`materialist train ...`: the sub-commands that make training data and train networks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from materialist.cli import train_data
from materialist.cli.generate import add_command
from materialist.cli.options import Learning, Training, output_option
from materialist.cli.outcome import report_success
from materialist.cli.progress import StageProgress
from materialist.errors import Interrupted
from materialist.option_kinds import OperationOptions, option

if TYPE_CHECKING:
    from materialist.train.trainer import Progress

train = typer.Typer(
    name="train",
    help="Make training data, and train the networks that predict materials.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


# fmt: off


@dataclass(frozen=True, kw_only=True)
class RecipeChanges(OperationOptions):
    """What differs from the recipe of the network."""

    config: str = option(
        "bundled", "The network that ships, or the paper's.", kind="word", choices=("bundled", "paper"))
    batch: int | None = option(None, "Pictures a step; default: the recipe's.", kind="whole")
    size: int | None = option(
        None, "Side of all crops, pixels; default: the recipe's, small ones first.", kind="whole")
    rate: float | None = option(None, "Peak learning rate; default: the recipe's.")
    init: Path | None = option(
        None, "Weights to begin from; bundled: those of a run, paper: Depth Anything or DINOv2.", kind="file")


@dataclass(frozen=True, kw_only=True)
class Views(OperationOptions):
    """The views that RefractionNet learns from."""

    data: Path | None = option(
        None, "Folder for the views, used again by later runs; default: RUN/views.", kind="file")
    shapes: int = option(640, "Shapes to learn from.", kind="whole", low=1)
    views: int = option(24, "Views of each.", kind="whole", low=1)
    heldout: int = option(64, "Shapes kept aside for the figures.", kind="whole", low=1)


# fmt: on


def register(app: typer.Typer) -> None:
    """Add the command group."""
    train_data.register(train)
    add_command(train, matnet)
    add_command(train, refraction)
    add_command(train, clicks)
    app.add_typer(train)


def matnet(
    data: Annotated[
        list[Path],
        typer.Option(
            help="A set made by `materialist train data` (several: give it again), or an InteriorVerse folder."
        ),
    ],
    output: Annotated[Path, output_option("RUN", "Folder of the run.")],
    recipe: RecipeChanges,
    training: Training = Training(every=300),  # noqa: B008
    score_samples: Annotated[int, typer.Option(help="Samples kept aside that each checkpoint is scored on.")] = 12,
    workers: Annotated[int, typer.Option(help="Processes that load data.")] = 1,
) -> None:
    """Train a network of all maps; RUN/weights.safetensors holds it, ready to use."""
    from materialist.io.datasets import open_sources
    from materialist.train import bundled
    from materialist.train import matnet as paper

    make: Any
    make, base = {
        "bundled": (bundled.BundledTask, bundled.RECIPE), "paper": (paper.PaperTask, paper.RECIPE)
    }[recipe.config]  # fmt: skip
    chosen = base.changed(batch=recipe.batch, side=recipe.size, rate=recipe.rate)
    task = lambda begin, _: make(open_sources(data), chosen, init=begin, score_samples=score_samples)  # noqa: E731
    _train("matnet", task, output, training, init=recipe.init, workers=workers)


def refraction(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    views: Views,
    training: Training,
    learning: Learning = Learning(batch=32, rate=2e-3),  # noqa: B008
) -> None:
    """Train RefractionNet on procedural shapes; RUN/weights.safetensors holds it, ready to use."""
    from materialist.predict.refraction.network import RefractionNet
    from materialist.procedural.thickness.dataset import ViewPlan, produce
    from materialist.train.refraction import RECIPE, RefractionTask

    folder = views.data or output / "views"
    lessons, aside = folder / "train", folder / "heldout"
    plans = {
        aside: ViewPlan(views.heldout, min(views.views, 8), "heldout", training.seed),
        lessons: ViewPlan(views.shapes, views.views, "train", training.seed),
    }
    recipe = RECIPE.changed(batch=learning.batch, rate=learning.rate, bfloat16=learning.bfloat16)

    def task(begin: Path | None, progress: Progress) -> Any:
        if begin is not None:
            RefractionNet.load(begin)  # views take long: refuse other weights before they are made
        for place, plan in plans.items():
            produce(place, plan, progress)
        return RefractionTask(lessons, aside, recipe, init=begin)

    _train("refraction", task, output, training, init=learning.init, minutes=30)


def clicks(
    output: Annotated[Path, output_option("RUN", "Folder of the run and its views.")],
    data: Annotated[Path, typer.Option(metavar="SET", help="A data set of: materialist train data.")],
    training: Training,
    learning: Learning,
) -> None:
    """Train ClickNet on procedural pictures as the bundled network sees them; RUN/weights.safetensors holds it."""
    from materialist.train.clicks import RECIPE, ClickTask, produce_views

    recipe = RECIPE.changed(batch=learning.batch, rate=learning.rate, bfloat16=learning.bfloat16)

    def task(begin: Path | None, progress: Progress) -> Any:
        produce_views(data, output / "views", progress)
        return ClickTask(output / "views", recipe, init=begin)

    _train("clicks", task, output, training, init=learning.init, minutes=40)


def _train(
    kind: str, make_task: Callable[[Path | None, Progress], Any], output: Path, training: Training, *,
    init: Path | None, minutes: float | None = None, workers: int = 0,
) -> None:  # fmt: skip
    """Train the task that `make_task` makes of (weights to begin from, progress), in the folder `output`.

    `minutes` are those of a run that names neither steps nor minutes. Errors that make a run impossible are raised
    before `make_task` is called, which may take long.
    """
    from materialist.predict.device import on_gpu
    from materialist.train import checkpoint
    from materialist.train.schedule import Budget
    from materialist.train.trainer import RunOptions, Trainer

    unlimited = training.steps is None and training.minutes is None
    budget = Budget(training.steps, minutes if unlimited else training.minutes)
    options = RunOptions(checkpoint_seconds=training.every, workers=workers, seed=training.seed)
    device = "cuda" if on_gpu(training.device) else "cpu"
    note = (lambda _: None) if training.as_json else lambda text: typer.echo(text, err=True)
    checkpoint.resumed(output, kind, resume=training.resume)
    with StageProgress(quiet=training.as_json) as progress:
        trainer = Trainer(
            make_task(init, progress), output, budget=budget, options=options, device=device, resume=training.resume,
            note=note,
        )  # fmt: skip
        scores = trainer.fit(progress)
    step, sheet = trainer.schedule.step, output / "sheet.png"
    if trainer.interrupted:
        raise Interrupted(f"Interrupted at step {step}; the same command with --resume goes on.")
    lines = [f"{output / checkpoint.WEIGHTS}: step {step}.", *([f"Look at {sheet}"] if sheet.is_file() else [])]
    if "of" in scores:
        lines.insert(1, f"The figures are of {scores['of']}.")
    facts = {"run": str(output), "step": step, "scored_on": scores.pop("of", None)}
    report_success(f"train {kind}", training.as_json, lines, **facts, **scores)
