"""`materialist batch DIR -o RUNS`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import materialist as mt
from materialist.batches.options import BatchOptions
from materialist.cli.options import Computing, output_option
from materialist.cli.outcome import report_success
from materialist.cli.progress import stage_progress
from materialist.errors import Interrupted

if TYPE_CHECKING:
    from materialist.batches.outcome import Outcome, Status
    from materialist.types import Progress


def batch_command(
    source: Annotated[
        str,
        typer.Argument(
            metavar="SOURCE",
            help="A folder of photos (with its subfolders), a list file, or a URL.",
        ),
    ],
    output: Annotated[Path, output_option("RUNS", "Folder of the results.")],
    options: BatchOptions,
    computing: Computing,
    predictor: Annotated[
        str, typer.Option(help="As for invert; {name} in maps:DIR is the photo's.")
    ] = "auto",
    fov: Annotated[
        str, typer.Option(help="Horizontal field of view in degrees, or auto: EXIF, else 35.")
    ] = "auto",
    size: Annotated[int, typer.Option(help="Working size: longer side, pixels.")] = 512,
    layer: Annotated[
        str | None, typer.Option(help="Which layer of EXR files is the photo.")
    ] = None,
) -> None:
    """Invert many photos, and apply a list of edits to each. Exit code 0: all done; 2: some failed, with reasons."""
    chosen: Any = {} if layer is None else {"layer": layer}
    try:
        with stage_progress(quiet=computing.as_json) as bars:
            # Options of the file's own class go by name; shared ones come from the command line.
            outcome = mt.batch(
                source,
                output,
                **vars(options),
                **chosen,
                predictor=predictor,
                size=size,
                fov=fov,
                seed=computing.seed,
                device=computing.device,
                progress=lambda status: _show(bars, status, computing.as_json),
            )
    except KeyboardInterrupt:
        raise Interrupted(
            "Interrupted; what is done stays. Go on with the same command and --resume."
        ) from None
    try:
        _report(outcome, output, computing.as_json)
    finally:  # also where the reader of a pipe left
        if outcome.exit_code:
            raise typer.Exit(outcome.exit_code)


def _report(outcome: Outcome, output: Path, as_json: bool) -> None:
    # At most twenty failures by name: summary.csv has all.
    failed = [row for row in outcome.rows if row["status"] == "failed"]
    kept = f" ({outcome.kept} of them before)" if outcome.kept else ""
    lines = [
        f"{outcome.count('done')} of {len(outcome.rows)} photos done{kept} in {outcome.seconds:.0f} s."
    ]
    lines += [f"Failed: {row['id']}: {row['reason']}" for row in failed[:20]]
    lines += [f"... and {len(failed) - 20} more; see summary.csv"] if len(failed) > 20 else []
    lines += [f"Note: {note}" for note in outcome.notes]
    lines.append(f"Look at {output / 'index.html'}")
    # The same as JSON, with all failures.
    report_success(
        "batch",
        as_json,
        lines,
        ok=not outcome.exit_code,
        runs=str(output),
        photos=len(outcome.rows),
        done=outcome.count("done"),
        failed=len(failed),
        kept=outcome.kept,
        seconds=outcome.seconds,
        hash=outcome.hash,
        notes=list(outcome.notes),
        failures=[{"id": row["id"], "reason": row["reason"]} for row in failed],
        exit_code=outcome.exit_code,
    )


def _show(bars: Progress, status: Status, quiet: bool) -> None:
    """The state of the batch as a bar, and what has just happened as a line."""
    over = status.done + status.failed
    bars("photos", over, status.total)
    if status.news and not quiet:
        typer.echo(f"[{over}/{status.total}] {status.news}", err=True)
