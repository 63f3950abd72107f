"""Commands of other distributions: entry points of the group `materialist.commands`, each a group of commands.

The benchmarks and the training come so, from the laboratory (materialist-photo-lab); this package never imports it.
"""

from importlib.metadata import EntryPoint, entry_points
from typing import Any

import typer
from typer.core import TyperGroup

from materialist.cli.generate import group
from materialist.errors import SetupError
from materialist.install import LABORATORY, laboratory_advice

GROUP = "materialist.commands"
LABORATORY_COMMANDS = ("bench", "train")


class Program(TyperGroup):
    """The commands of the product, then those of other distributions, which are loaded when one is asked for."""

    def list_commands(self, ctx: Any) -> list[str]:
        return [*super().list_commands(ctx), *sorted({*LABORATORY_COMMANDS, *_installed()})]

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        return super().get_command(ctx, cmd_name) or _plugin(cmd_name)


def _installed() -> dict[str, EntryPoint]:
    return {point.name: point for point in entry_points(group=GROUP)}


def _plugin(name: str) -> Any:
    """The installed commands of that name; one that says what is missing in their place; None for an unknown name."""
    point = _installed().get(name)
    if point is not None:
        try:
            return typer.main.get_group(point.load())
        except Exception as error:  # whatever another distribution raises; ours still work
            reason = f"cannot be loaded from {point.value} ({error}); install it again."
            return _refusal(name, "Cannot be loaded.", f"materialist {name} {reason}")
    if name in LABORATORY_COMMANDS:
        reason = "is in the laboratory, which is not installed; install it with:"
        message = f"materialist {name} {reason} {laboratory_advice()}"
        return _refusal(name, f"In the laboratory: {LABORATORY}.", message)
    return None


def _refusal(name: str, help: str, message: str) -> Any:
    """A command that takes whatever follows its name, --help included, and raises SetupError with the message."""
    single = group(name, "")
    anything = {"allow_extra_args": True, "ignore_unknown_options": True}

    @single.command(name, help=help, add_help_option=False, context_settings=anything)
    def refuse(context: typer.Context) -> None:
        raise SetupError(message)

    return typer.main.get_command(single)
