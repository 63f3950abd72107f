"""`materialist batch DIR -o RUNS`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from materialist.cli.options import Device, DeviceOption, FieldOfView, Json, Seed, WorkingSize, output_option
from materialist.cli.outcome import INTERRUPTED, report_success
from materialist.errors import MaterialistError

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from materialist.batches.outcome import Outcome, Status


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("batch")(batch)


class Interrupted(MaterialistError):
    """Ctrl-C, with how to go on."""

    exit_code = INTERRUPTED


def batch(
    context: typer.Context,
    source: Annotated[
        str,
        typer.Argument(metavar="SOURCE", help="A folder of photos (with its subfolders), a list file, or a URL."),
    ],
    output: Annotated[Path, output_option("RUNS", "Folder of the results.")],
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
    fov: FieldOfView = "auto",
    size: WorkingSize = 512,
    spp: Annotated[int, typer.Option(help="Paths per pixel of the edits' renderings.")] = 256,
    seed: Seed = 0,
    device: DeviceOption = Device.auto,
    as_json: Json = False,
    force: Annotated[
        bool, typer.Option("--force", help="Begin an earlier batch in RUNS anew; with --resume, under other options.")
    ] = False,
) -> None:
    """Invert many photos, and apply a list of edits to each. Exit code 0: all done; 2: some failed, with reasons."""
    from materialist.batches.run import batch as run

    try:
        with BatchProgress(quiet=as_json) as progress:
            outcome = run(
                source, output, apply=apply, workers=workers, ray=ray, resume=resume, force=force,
                predictor=predictor, size=size, fov=fov, seed=seed, device=device.value, spp=spp, progress=progress,
            )  # fmt: skip
    except KeyboardInterrupt:
        raise Interrupted(f"Interrupted; what is done stays. Go on with: {_again(context)}") from None
    _report(outcome, output, as_json)
    if outcome.exit_code:
        raise typer.Exit(outcome.exit_code)


def _again(context: typer.Context) -> str:
    """The command line that goes on: as it was given, with --resume."""
    given = context.params
    words = ["materialist", "batch", str(given["source"])]
    for option in context.command.params:
        name = str(option.name)
        source = context.get_parameter_source(name)
        told = source is not None and source.name == "COMMANDLINE"
        if name == "force":  # what was begun anew is there to go on with; under --resume it allows other options
            told = told and given["resume"]
        if told and name not in ("source", "resume"):
            words += [option.opts[0]] if given[name] is True else [option.opts[0], str(given[name])]
    return shlex.join([*words, "--resume"])


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
    """Context manager and callback: a bar over all photos with rate, time left and failures, and what is at work.

    Where stderr is no terminal there is a line for each photo instead, and with `quiet` nothing.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet, self._lines = quiet, not quiet and not sys.stderr.isatty()
        self._bars: Progress | None = None
        self._all: TaskID | None = None
        self._each: dict[str, TaskID] = {}

    def __enter__(self) -> BatchProgress:
        if not self._quiet and not self._lines:
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            self._bars = Progress(
                TextColumn("{task.description:<24}", markup=False), BarColumn(bar_width=16),
                TextColumn("{task.fields[note]}", markup=False), console=Console(stderr=True),
            )  # fmt: skip
            self._bars.start()
            self._all = self._bars.add_task("photos", total=None, note="looking at what is there")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bars is not None:
            self._bars.stop()

    def __call__(self, status: Status) -> None:
        """How the batch stands now."""
        if self._lines and status.news:
            over = status.done + status.failed
            typer.echo(f"[{over}/{status.total}] {status.news}", err=True)
        if self._bars is None or self._all is None:
            return
        if status.news and status.urgent:
            self._bars.console.print(status.news, markup=False, highlight=False)
        over = status.done + status.failed
        self._bars.update(self._all, completed=over, total=status.total, note=f"{over}/{status.total}  {_note(status)}")
        for name in [name for name in self._each if name not in status.running]:
            self._bars.remove_task(self._each.pop(name))
        for name, stage in status.running.items():
            if name not in self._each:
                self._each[name] = self._bars.add_task(f"  {name}"[:24], total=None, note=stage)
            self._bars.update(self._each[name], note=stage)


def _note(status: Status) -> str:
    parts: list[Any] = [f"{status.failed} failed"] if status.failed else []
    if status.rate:
        parts.append(f"{status.rate * 60:.1f} a minute")
    if status.left is not None:
        parts.append(f"{_span(status.left)} left")
    return ", ".join(parts)


def _span(seconds: float) -> str:
    """A duration as a person says it."""
    minutes = round(seconds / 60)
    if minutes < 2:
        return f"{seconds:.0f} s"
    return f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
