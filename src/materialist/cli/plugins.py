"""Commands of other distributions: entry points of the group `materialist.commands`, each a group of commands.

The benchmarks and the training come so, from the laboratory (materialist-photo-lab); this package never imports it.
"""

from importlib.metadata import EntryPoint, entry_points

import typer

from materialist.errors import SetupError
from materialist.install import LABORATORY, laboratory_command

GROUP = "materialist.commands"
LABORATORY_COMMANDS = ("bench", "train")


def add_to(app: typer.Typer) -> None:
    """Add the commands that are installed, and in place of the laboratory's, where it is not, one that says so."""
    points = {point.name: point for point in entry_points(group=GROUP)}
    for name, point in sorted(points.items()):
        _add_installed(app, name, point)
    for name in LABORATORY_COMMANDS:
        if name not in points:
            _add_refusal(app, name, f"In the laboratory: {LABORATORY}.", _how_to_install(name))


def _add_installed(app: typer.Typer, name: str, point: EntryPoint) -> None:
    try:
        plugin = point.load()
    except (
        Exception
    ) as error:  # whatever another distribution raises; the other commands still work
        message = (
            f"materialist {name} cannot be loaded from {point.value} ({error}); install it again."
        )
        _add_refusal(app, name, "Cannot be loaded.", message)
    else:
        app.add_typer(plugin, name=name)


def _add_refusal(app: typer.Typer, name: str, help: str, message: str) -> None:
    """A command that takes whatever follows its name, and ends with the message."""

    # Without --help of its own: that, too, ends with the message.
    @app.command(
        name,
        help=help,
        add_help_option=False,
        context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
    )
    def refuse(context: typer.Context) -> None:
        raise SetupError(message)


def _how_to_install(name: str) -> str:
    return (
        f"materialist {name} is in the laboratory, which is not installed; install it with: "
        f"{laboratory_command()}"
    )
