"""`materialist batch DIR -o RUNS`."""

from __future__ import annotations

import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated

import typer

from materialist.cli.generate import add_command
from materialist.cli.options import Computing, output_option
from materialist.cli.outcome import report_success
from materialist.errors import Interrupted

if TYPE_CHECKING:
    from rich.progress import Progress

    from materialist.batches.outcome import Outcome, Status


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, batch)


def batch(
    source: Annotated[
        str,
        typer.Argument(metavar="SOURCE", help="A folder of photos (with its subfolders), a list file, or a URL."),
    ],
    output: Annotated[Path, output_option("RUNS", "Folder of the results.")],
    computing: Computing,
    apply: Annotated[
        Path | None,
        typer.Option(metavar="EDITS", help="Edits for every photo; {name} in a mask's file name is the photo's."),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="Worker processes; else one a GPU, or one a processor as far as memory reaches.")
    ] = None,
    ray: Annotated[str | None, typer.Option(metavar="ADDRESS", help="A Ray cluster, or local.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the batch in RUNS.")] = False,
    predictor: Annotated[str, typer.Option(help="As for invert; {name} in maps:DIR is the photo's.")] = "auto",
    fov: Annotated[str, typer.Option(help="Horizontal field of view in degrees, or auto: EXIF, else 35.")] = "auto",
    size: Annotated[int, typer.Option(help="Working size: longer side, pixels.")] = 512,
    spp: Annotated[
        int | None, typer.Option(help="Paths per pixel of the edits; else 256 for glass and other light, 128.")
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Begin an earlier batch in RUNS anew; with --resume, under other options.")
    ] = False,
) -> None:
    """Invert many photos, and apply a list of edits to each. Exit code 0: all done; 2: some failed, with reasons."""
    from materialist.batches.run import batch as run

    try:
        with BatchProgress(quiet=computing.as_json) as progress:
            outcome = run(
                source, output, apply=apply, workers=workers, ray=ray, resume=resume, force=force,
                predictor=predictor, size=size, fov=fov, seed=computing.seed, device=computing.device, spp=spp,
                progress=progress,
            )  # fmt: skip
    except KeyboardInterrupt:
        raise Interrupted("Interrupted; what is done stays. Go on with the same command and --resume.") from None
    _report(outcome, output, computing.as_json)
    if outcome.exit_code:
        raise typer.Exit(outcome.exit_code)


def _report(outcome: Outcome, output: Path, as_json: bool) -> None:
    failed = [row for row in outcome.rows if row["status"] == "failed"]
    kept = f" ({outcome.kept} of them before)" if outcome.kept else ""
    lines = [f"{outcome.count('done')} of {len(outcome.rows)} photos done{kept} in {outcome.seconds:.0f} s."]
    lines += [f"Failed: {row['id']}: {row['reason']}" for row in failed[:20]]
    lines += [f"... and {len(failed) - 20} more; see summary.csv"] if len(failed) > 20 else []
    lines.append(f"Look at {output / 'index.html'}")
    report_success(
        "batch", as_json, lines, ok=not outcome.exit_code, runs=str(output), photos=len(outcome.rows),
        done=outcome.count("done"), failed=len(failed), kept=outcome.kept, seconds=outcome.seconds, hash=outcome.hash,
        failures=[{"id": row["id"], "reason": row["reason"]} for row in failed], exit_code=outcome.exit_code,
    )  # fmt: skip


class BatchProgress:
    """Context manager and callback: a bar over all photos with failures and what is at work.

    Where stderr is no terminal there is a line for each photo instead, and with `quiet` nothing.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self._bar: Progress | None = None
        if not quiet and sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            self._bar = Progress(
                BarColumn(bar_width=16), MofNCompleteColumn(), TimeRemainingColumn(),
                TextColumn("{task.description}", markup=False), console=Console(stderr=True),
                speed_estimate_period=3600,
            )  # fmt: skip

    def __enter__(self) -> BatchProgress:
        if self._bar is not None:
            self._bar.start()
            self._all = self._bar.add_task("looking at what is there", total=None)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def __call__(self, status: Status) -> None:
        """Show the state of the batch now."""
        over = status.done + status.failed
        if self._bar is not None:
            if status.news and status.urgent:
                self._bar.console.print(status.news, markup=False, highlight=False)
            words = [f"{status.failed} failed"] if status.failed else []
            words += [f"{name}: {stage}" for name, stage in list(status.running.items())[:3]]
            self._bar.update(self._all, completed=over, total=status.total, description=", ".join(words))
        elif status.news and not self._quiet:
            typer.echo(f"[{over}/{status.total}] {status.news}", err=True)
