"""The command line. Each command is a thin call of the public functions; heavy modules load only when one runs."""

from __future__ import annotations

import sys

import typer

from materialist.cli import batch, bench, edits, films, scenes, setup, studio, train
from materialist.cli.outcome import run_to_exit_code

app = typer.Typer(
    name="materialist",
    help="Physically based editing of a single photograph, by inverse rendering.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for module in (scenes, setup, bench, train, edits, films, batch, studio):
    module.register(app)


def _show_version(wanted: bool) -> None:
    if wanted:
        from materialist import __version__

        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _root(
    version: bool = typer.Option(False, "--version", callback=_show_version, is_eager=True, help="Print the version."),
) -> None:
    """Physically based editing of a single photograph, by inverse rendering."""


def main() -> None:
    """Entry point of the `materialist` command."""
    sys.exit(run_to_exit_code(app, sys.argv[1:]))
