"""`materialist models list|download|verify`: networks from a model hub, fetched only when one says so."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from materialist.cli.options import Json
from materialist.cli.outcome import report_success
from materialist.errors import InputError, WeightsError

models = typer.Typer(
    name="models",
    help="List, download and verify networks from a model hub; no other command ever downloads.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def register(app: typer.Typer) -> None:
    """Add the command group."""
    app.add_typer(models)


@models.command("list")
def list_models(as_json: Json = False) -> None:
    """Say which models there are, what they are for, and which are on this machine."""
    from materialist.predict.models import KNOWN, folder_of, is_complete, models_folder

    found = [
        {"name": m.name, "repo": m.repo, "purpose": m.purpose, "licence": m.licence, "megabytes": m.megabytes,
         "here": is_complete(m), "folder": str(folder_of(m))}
        for m in KNOWN
    ]  # fmt: skip
    lines = [
        f"{'here' if m['here'] else '-':<5}{m['name']:<21}{m['megabytes']:>5} MB  {m['purpose']} "
        f"({m['repo']}; licence: {m['licence']})"
        for m in found
    ]
    report_success("models list", as_json, [*lines, f"Folder: {models_folder()}"], models=found)


@models.command("download")
def download_model(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A name of the list, or a hub id as owner/name.")],
    force: Annotated[bool, typer.Option("--force", help="Fetch every file again.")] = False,
    source: Annotated[
        Path | None, typer.Option("--from", metavar="FOLDER", help="Take files that were fetched elsewhere.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Fetch a model and check it against the hub's checksums; an interrupted download is taken up again."""
    from materialist.cli.progress import StageProgress
    from materialist.predict.models import adopt, download, hub_model

    if source is not None:
        folder, taken = adopt(hub_model(name), source)
        lines = [f"{name}: {taken / 1e6:.0f} MB taken from {source}; it lies in {folder}"]
        report_success("models download", as_json, lines, folder=str(folder), bytes=taken)
        return
    with StageProgress(quiet=as_json) as progress:
        folder, fetched = download(hub_model(name), force=force, progress=progress)
    lines = [f"{name}: {fetched / 1e6:.0f} MB fetched; checksums are right; it lies in {folder}"]
    report_success("models download", as_json, lines, folder=str(folder), bytes=fetched)


@models.command("verify")
def verify_model(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="Models; all that are here when none is named.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Compute the checksums of downloaded models again and compare them with those written at the download."""
    from materialist.predict.models import downloaded, hub_model, models_folder, require
    from materialist.predict.weights import verify_folder

    folders = {name: require(hub_model(name)) for name in names} if names else downloaded()
    if not folders:
        raise InputError(f"No model is in {models_folder()}; fetch one with: materialist models download NAME")
    damaged, digests = [], {}
    for name, folder in folders.items():
        try:
            digests[name] = verify_folder(folder)
        except WeightsError as error:
            damaged.append(str(error))
    if damaged:
        raise WeightsError(" ".join(damaged))
    lines = [f"{name}: whole (sha256 of its list {digest[:16]})" for name, digest in digests.items()]
    report_success("models verify", as_json, lines, digests=digests)
