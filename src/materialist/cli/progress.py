"""A progress bar on stderr for each stage, driven by `progress(stage, done, total)` callbacks."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # numpy, which it needs, would slow every --help
    from materialist.types import Progress

SPEED_PERIOD = 600.0
"""Seconds of which the time left is estimated; a path-traced step may take a minute."""


@contextmanager
def stage_progress(quiet: bool = False) -> Iterator[Progress]:
    """A callback `progress(stage, done, total)`: a new stage name opens a bar and completes the one before.

    Nothing is drawn when stderr is not a terminal or `quiet` is set.
    """
    from rich import progress as rich
    from rich.console import Console

    # On stderr: stdout is for results.
    console = Console(stderr=True)
    tasks = dict[str, rich.TaskID]()
    name = rich.TextColumn("{task.description:<24}")
    left = rich.TimeRemainingColumn(elapsed_when_finished=True)
    columns = name, rich.BarColumn(bar_width=32), rich.MofNCompleteColumn(), left
    with rich.Progress(
        *columns,
        console=console,
        disable=quiet or not console.is_terminal,
        speed_estimate_period=SPEED_PERIOD,
    ) as bars:

        def update(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                for task in bars.tasks:  # one that stopped early shows what it did as its total
                    if not task.finished:
                        bars.update(
                            task.id, total=max(task.completed, 1), completed=max(task.completed, 1)
                        )
                tasks[stage] = bars.add_task(stage, total=max(total, 1))
            bars.update(tasks[stage], completed=done, total=max(total, 1))

        yield update
