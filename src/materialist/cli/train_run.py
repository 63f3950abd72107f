"""What the commands that train a network do alike: start or resume the run, and report it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from materialist.cli.outcome import report_success
from materialist.cli.progress import StageProgress
from materialist.errors import Interrupted

if TYPE_CHECKING:
    from materialist.train.schedule import Budget
    from materialist.train.task import Task
    from materialist.train.trainer import Progress, RunOptions


def train_run(
    kind: str, make_task: Callable[[Path | None, Progress], Task], output: Path, *, budget: Budget,
    options: RunOptions, init: Path | None, device: str, resume: bool, as_json: bool,
) -> None:  # fmt: skip
    """Train the task that `make_task` makes of (weights to begin from, progress), in the folder `output`.

    What makes a run impossible is told before `make_task` is called, which may take long.
    """
    from materialist.train import checkpoint
    from materialist.train.processes import join
    from materialist.train.trainer import Trainer

    processes = join(device)
    quiet = as_json or not processes.first
    note = (lambda _: None) if quiet else lambda text: typer.echo(text, err=True)
    checkpoint.resumed(output, kind, resume=resume)
    if init is not None and resume and checkpoint.exists(output):
        note(f"--init is where a run begins; that in {output} goes on from its checkpoint.")
        init = None
    try:
        with StageProgress(quiet=quiet) as progress:
            task = make_task(init, progress)
            trainer = Trainer(
                task, output, budget=budget, options=options, processes=processes, resume=resume, note=note
            )
            scores = trainer.fit(progress)
    finally:
        processes.leave()
    if not processes.first:
        return
    step, sheet = trainer.schedule.step, output / "sheet.png"
    if trainer.interrupted:
        raise Interrupted(f"Interrupted at step {step}; the same command with --resume goes on.")
    lines = [f"{output / checkpoint.WEIGHTS}: step {step}.", *([f"Look at {sheet}"] if sheet.is_file() else [])]
    if "of" in scores:
        lines.insert(1, f"The figures are of {scores['of']}.")
    facts = {"run": str(output), "step": step, "scored_on": scores.pop("of", None)}
    report_success(f"train {kind}", as_json, lines, **facts, **scores)
