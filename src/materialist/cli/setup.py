"""`materialist doctor` and `materialist models`: what this machine has, and networks from a model hub."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from materialist.cli.options import Computing, Json
from materialist.cli.outcome import BAD_INPUT, report_success
from materialist.errors import InputError, WeightsError

if TYPE_CHECKING:
    from materialist.doctor import Finding

_MARK = {"ok": ("ok", "green"), "missing": ("--", "yellow"), "broken": ("NO", "red")}


def doctor(computing: Computing) -> None:
    """Say what works here, what does not, and the one command that mends it; with --device cuda a GPU must be there."""
    from materialist.doctor import examine

    findings = examine(computing.device)
    as_json = computing.as_json
    # Missing extras are no failure: the main job runs without them.
    broken = [finding for finding in findings if finding.state == "broken"]
    verdict = (
        "The main job cannot run yet; run the commands above."
        if broken
        else "Ready: materialist invert PHOTO -o SCENE"
    )
    rows = [vars(finding) for finding in findings]
    lines = [*map(_line, findings), verdict]
    report_success(
        "doctor",
        as_json,
        lines,
        ok=not broken,
        findings=rows,
        exit_code=BAD_INPUT if broken else 0,
    )
    if broken:
        raise typer.Exit(BAD_INPUT)


def _line(finding: Finding) -> str:
    """A line of the table, and under it the command that mends what fails."""
    mark, colour = _MARK[finding.state]
    line = f"{typer.style(f'{mark:>3}', fg=colour, bold=True)} {finding.name:<22}{finding.detail}"
    return line + (
        f"\n{'mend with: ':>37}{typer.style(finding.remedy, bold=True)}" if finding.remedy else ""
    )


def list_models(as_json: Json = False) -> None:
    """Say which models there are, what they are for, and which are on this machine."""
    from materialist.predict.models import KNOWN, folder_of, is_complete, models_folder

    rows = [{**vars(m), "here": is_complete(m), "folder": str(folder_of(m))} for m in KNOWN]
    lines = [
        f"{'here' if m['here'] else '-':<5}{m['name']:<21}{m['megabytes']:>5} MB  {m['purpose']} "
        f"({m['repo']}; licence: {m['licence']})"
        for m in rows
    ]
    report_success("models list", as_json, [*lines, f"Folder: {models_folder()}"], models=rows)


def download_model(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A name of the list, or a hub id as owner/name.")
    ],
    force: Annotated[bool, typer.Option("--force", help="Fetch every file again.")] = False,
    source: Annotated[
        Path | None,
        typer.Option("--from", metavar="FOLDER", help="Take files that were fetched elsewhere."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Fetch a model and check it against the hub's checksums; an interrupted download is taken up again."""
    from materialist.predict.models import adopt, download, hub_model

    model = hub_model(name)
    folder = adopt(model, source) if source is not None else download(model, force=force)
    report_success(
        "models download",
        as_json,
        [f"{name} lies in {folder}; its checksums are written"],
        folder=str(folder),
    )


def verify_model(
    names: Annotated[
        list[str] | None,
        typer.Argument(metavar="[NAME]...", help="Models; all that are here when none is named."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compute the checksums of downloaded models again and compare them with those written at the download."""
    from materialist.predict.models import downloaded, hub_model, models_folder, require
    from materialist.predict.weights import verify_folder

    # Without names all that are here; none is a question that was misunderstood.
    folders = {name: require(hub_model(name)) for name in names} if names else downloaded()
    if not folders:
        raise InputError(
            f"No model is in {models_folder()}; fetch one with: materialist models download NAME"
        )
    damaged = []
    digests = {}
    for name, folder in folders.items():
        try:
            digests[name] = verify_folder(folder)
        except WeightsError as error:
            # The others are checked all the same.
            damaged.append(str(error))
    if damaged:
        raise WeightsError(" ".join(damaged))
    lines = [
        f"{name}: whole (sha256 of its list {digest[:16]})" for name, digest in digests.items()
    ]
    report_success("models verify", as_json, lines, digests=digests)
