"""A progress bar on stderr for each stage, driven by `progress(stage, done, total)` callbacks."""

from __future__ import annotations

from types import TracebackType
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID


class StageProgress:
    """Context manager and callback: `with StageProgress() as progress: work(progress=progress)`.

    Calls come as `progress(stage, done, total)`: a new stage name opens a new bar and completes the one before.
    Nothing is drawn when stderr is not a terminal or `quiet` is set.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self._bars: Progress | None = None
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> StageProgress:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True)
        self._bars = Progress(
            TextColumn("{task.description:<24}"),
            BarColumn(bar_width=32),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            console=console,
            disable=self._quiet or not console.is_terminal,
        )
        self._bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        assert self._bars is not None
        self._bars.stop()

    def __call__(self, stage: str, done: int, total: int) -> None:
        """Stage `stage` has finished `done` of `total` steps."""
        assert self._bars is not None
        if stage not in self._tasks:
            self._complete()
            self._tasks[stage] = self._bars.add_task(stage, total=max(total, 1))
        self._bars.update(self._tasks[stage], completed=done, total=max(total, 1))

    def _complete(self) -> None:
        """Stop the clock of the stages before; one that stopped early shows what it did as its total."""
        assert self._bars is not None
        for task in self._bars.tasks:
            if not task.finished:
                self._bars.update(task.id, total=max(task.completed, 1), completed=max(task.completed, 1))
