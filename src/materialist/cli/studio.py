"""`materialist studio [PHOTO|SCENE]`."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import Computing
from materialist.cli.outcome import report_success
from materialist.option_kinds import option


@dataclass(frozen=True, kw_only=True)
class Serving(Computing):
    """Who can reach the studio, and what it works with."""

    # Where it is served.
    host: str = option(
        "127.0.0.1",
        "Address to serve on; other than this machine needs a password or --open.",
        kind="name",
    )
    port: int = option(7860, "Port.", kind="whole", low=1, high=65535, called="--port")
    work: Path = option(
        Path("materialist-studio"), "Where scenes and edits are kept.", kind="file", metavar="DIR"
    )
    # Who may come in.
    password: str | None = option(
        None,
        "Ask everyone for it; `ps` shows an argument, so MATERIALIST_PASSWORD may hold it.",
        kind="name",
        metavar="WORD",
    )
    password_file: Path | None = option(
        None, "Its first line is the password.", kind="file", metavar="FILE"
    )
    behind_proxy: str | None = option(
        None, "The name that people ask a proxy before the studio for.", kind="name", metavar="HOST"
    )
    everyone: bool = option(
        False, "Let everybody in who can reach --host.", kind="switch", flag="--open"
    )
    workers: int = option(
        1,
        "How many fits and renderings may run at once.",
        kind="whole",
        low=1,
        high=64,
        called="--workers",
        metavar="N",
    )


def studio_command(
    serving: Serving,
    target: Annotated[
        str | None,
        typer.Argument(
            metavar="[PHOTO|SCENE]", help="What to open first: a photo, or a scene package."
        ),
    ] = None,
) -> None:
    """Open the studio: a page in the browser to take photos apart and edit them."""
    from materialist.darkroom import require_packages

    require_packages()
    from materialist.darkroom.app import application
    from materialist.studio import server
    from materialist.studio.workspace import Project

    # --- Who may reach it, checked before anything is made ---
    password = server.password_of(
        serving.password or os.environ.get("MATERIALIST_PASSWORD"), serving.password_file
    )
    single_user = server.check_host(serving.host, password, serving.everyone, serving.behind_proxy)
    server.check_port(serving.host, serving.port)
    if serving.device != "auto":
        from materialist.render.variant import setup

        setup(serving.device)
    # --- The studio, and what it opens first ---
    first = None if target is None else server.checked_target(target)
    studio = server.new_studio(
        serving.work,
        single_user=single_user,
        workers=serving.workers,
        seed=serving.seed,
        device=serving.device,
    )
    studio.start = None if first is None else server.first_shown(studio.work, first)
    if not (isinstance(studio.start, Project) or studio.last):
        # Long before the page is there: somebody chooses a photo next.
        studio.get_ready()
    if not serving.as_json:
        typer.echo(f"Scenes and edits are kept in {studio.work.root}")

    def on_ready(address: str) -> None:
        lines = [f"The studio is open at {address} (Ctrl-C ends it)"]
        report_success(
            "studio", serving.as_json, lines, address=address, work=str(studio.work.root)
        )

    page = application(
        studio,
        host=serving.host,
        port=serving.port,
        password=password,
        proxy=serving.behind_proxy,
    )
    server.serve(
        studio,
        page,
        host=serving.host,
        port=serving.port,
        proxy=serving.behind_proxy,
        on_ready=on_ready,
    )
