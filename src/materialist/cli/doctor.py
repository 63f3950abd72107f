"""`materialist doctor`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from materialist.cli.options import Device, DeviceOption, Json, Seed
from materialist.cli.outcome import BAD_INPUT, report_success

if TYPE_CHECKING:
    from materialist.doctor import Finding

_MARK = {"ok": ("ok", "green"), "missing": ("--", "yellow"), "broken": ("NO", "red")}


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command("doctor")(doctor)


def doctor(seed: Seed = 0, device: DeviceOption = Device.auto, as_json: Json = False) -> None:
    """Say what works here, what does not, and the one command that mends it; with --device cuda a GPU must be there."""
    from materialist.doctor import examine

    findings = examine(device.value)
    broken = [finding for finding in findings if finding.state == "broken"]
    if not as_json:
        _show(findings)
    verdict = (
        "The main job cannot run yet; run the commands above." if broken else "Ready: materialist invert PHOTO -o SCENE"
    )
    if as_json and broken:
        import json

        content = {"ok": False, "command": "doctor", "findings": [vars(f) for f in findings], "exit_code": BAD_INPUT}
        typer.echo(json.dumps(content))
    else:
        report_success("doctor", as_json, [verdict], findings=[vars(finding) for finding in findings])
    if broken:
        raise typer.Exit(BAD_INPUT)


def _show(findings: list[Finding]) -> None:
    """The table, and under each failing line the command that mends it."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False, soft_wrap=True)
    for finding in findings:
        mark, colour = _MARK[finding.state]
        console.print(Text.assemble((f"{mark:>3} ", f"bold {colour}"), f"{finding.name:<22}", finding.detail))
        if finding.remedy:
            console.print(Text.assemble(" " * 26, ("mend with: ", "dim"), (finding.remedy, "bold")))
