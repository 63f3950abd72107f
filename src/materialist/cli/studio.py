"""`materialist studio [PHOTO|SCENE]`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import Computing
from materialist.cli.outcome import report_success


def studio(
    target: Annotated[
        str | None, typer.Argument(metavar="[PHOTO|SCENE]", help="What to open first: a photo, or a scene package.")
    ] = None,
    host: Annotated[
        str, typer.Option(help="Address to serve on; other than this machine needs --password or --open.")
    ] = ("127.0.0.1"),
    port: Annotated[int, typer.Option(help="Port.")] = 7860,
    work: Annotated[Path, typer.Option(metavar="DIR", help="Where scenes and edits are kept.")] = Path(
        "materialist-studio"
    ),
    password: Annotated[str | None, typer.Option(metavar="WORD", help="Ask everyone for it.")] = None,
    everyone: Annotated[bool, typer.Option("--open", help="Let everybody in who can reach --host.")] = False,
    workers: Annotated[int, typer.Option(metavar="N", help="How many fits and renderings may run at once.")] = 1,
    computing: Computing = Computing(),  # noqa: B008
) -> None:
    """Open the studio: a page in the browser to take photos apart and edit them."""
    from materialist.studio.server import check_host, check_port, first_target, new_studio, serve

    single_user = check_host(host, password, everyone)
    check_port(host, port)
    if computing.device != "auto":
        from materialist.render.variant import setup

        setup(computing.device)
    made = new_studio(work, single_user=single_user, workers=workers, seed=computing.seed, device=computing.device)
    made.start = first_target(made.work, target)
    if not computing.as_json:
        typer.echo(f"Scenes and edits are kept in {made.work.root}")

    def on_ready(address: str) -> None:
        lines = [f"The studio is open at {address} (Ctrl-C ends it)"]
        report_success("studio", computing.as_json, lines, address=address, work=str(made.work.root))

    serve(made, host=host, port=port, password=password, on_ready=on_ready)
