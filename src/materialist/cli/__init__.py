"""The command line. Each command is a thin call of the public functions; heavy modules load only when one runs."""

import sys
from collections.abc import Callable
from typing import Any

import typer

from materialist.cli import batch, edits, plugins, scenes, setup, studio
from materialist.cli.generate import add_command, group
from materialist.cli.outcome import run_to_exit_code

ABOUT = "Physically based editing of a single photograph, by inverse rendering."
MODELS = "List, download and verify networks from a model hub; no other command ever downloads."
COMMANDS: tuple[Callable[..., Any], ...] = (
    scenes.invert,
    scenes.render,
    scenes.export,
    setup.doctor,
    edits.select,
    edits.edit,
    edits.glass,
    edits.remove,
    edits.insert,
    edits.apply,
    edits.relight,
    edits.drop,
    batch.batch,
    studio.studio,
)
app = group("materialist", ABOUT, cls=plugins.Program)
for command in COMMANDS:
    add_command(app, command)
models = group("models", MODELS, app)
add_command(models, setup.list_models, "list")
add_command(models, setup.download_model, "download")
add_command(models, setup.verify_model, "verify")


def _show_version(wanted: bool) -> None:
    if wanted:
        from materialist import __version__

        typer.echo(__version__)
        raise typer.Exit


@app.callback(help=ABOUT)
def _root(
    version: bool = typer.Option(
        False, "--version", callback=_show_version, is_eager=True, help="Print the version."
    ),
) -> None: ...


def main() -> None:
    sys.exit(run_to_exit_code(app, sys.argv[1:]))
