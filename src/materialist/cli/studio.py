"""`materialist studio [PHOTO|SCENE]`."""

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
        str, typer.Option(help="Address to serve on; other than this machine needs a password or --open.")
    ] = ("127.0.0.1"),
    port: Annotated[int, typer.Option(help="Port.")] = 7860,
    work: Annotated[Path, typer.Option(metavar="DIR", help="Where scenes and edits are kept.")] = Path(
        "materialist-studio"
    ),
    password: Annotated[
        str | None,
        typer.Option(
            metavar="WORD", envvar="MATERIALIST_PASSWORD", help="Ask everyone for it; `ps` shows an argument."
        ),
    ] = None,
    password_file: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Its first line is the password.", show_default=False)
    ] = None,
    behind_proxy: Annotated[
        str | None, typer.Option(metavar="HOST", help="The name that people ask a proxy before the studio for.")
    ] = None,
    everyone: Annotated[bool, typer.Option("--open", help="Let everybody in who can reach --host.")] = False,
    workers: Annotated[int, typer.Option(metavar="N", help="How many fits and renderings may run at once.")] = 1,
    computing: Computing = Computing(),  # noqa: B008
) -> None:
    """Open the studio: a page in the browser to take photos apart and edit them."""
    from materialist.studio.server import check_host, check_port, first_target, new_studio, password_of, serve

    password = password_of(password, password_file)
    single_user = check_host(host, password, everyone, behind_proxy)
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

    serve(made, host=host, port=port, password=password, proxy=behind_proxy, on_ready=on_ready)
