"""The command line. Each command is a thin call of the public functions; heavy modules load only when one runs."""

import sys
from collections.abc import Callable
from typing import Any

import typer

from materialist.cli import batch, edits, plugins, scenes, setup, studio
from materialist.cli.generate import add_command, group
from materialist.cli.outcome import run_to_exit_code
from materialist.edits.registry import OPERATIONS

ABOUT = "Physically based editing of a single photograph, by inverse rendering."
MODELS = "List, download and verify networks from a model hub; no other command ever downloads."
COMMANDS: dict[str, Callable[..., Any]] = {
    "invert": scenes.invert_command,
    "render": scenes.render_command,
    "export": scenes.export_command,
    "doctor": setup.doctor,
    "select": edits.select_command,
    **{name: edits.operation_command(operation) for name, operation in OPERATIONS.items()},
    # These two make films as well.
    "relight": edits.relight_command,
    "drop": edits.drop_command,
    "apply": edits.apply_command,
    "batch": batch.batch_command,
    "studio": studio.studio_command,
}
"""Name -> function of each command, in the order of the help."""
# --- The commands ---
app = group("materialist", ABOUT, cls=plugins.Program)
for name, command in COMMANDS.items():
    add_command(app, command, name)
# --- Groups of commands ---
models = group("models", MODELS, app)
add_command(models, setup.list_models, "list")
add_command(models, setup.download_model, "download")
add_command(models, setup.verify_model, "verify")


def _show_version(is_given: bool) -> None:
    if is_given:
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
