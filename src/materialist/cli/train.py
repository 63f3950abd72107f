"""`materialist train ...`: the sub-commands that make training data and train networks."""

from __future__ import annotations

import typer

from materialist.cli import train_clicks, train_data, train_matnet, train_refraction

train = typer.Typer(
    name="train",
    help="Make training data, and train the networks that predict materials.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)
for module in (train_data, train_matnet, train_refraction, train_clicks):
    module.register(train)


def register(app: typer.Typer) -> None:
    """Add the command group."""
    app.add_typer(train)
