"""edits.yaml with its files as a zip: taken away from one photo's desk, and loaded on the same or another."""

from __future__ import annotations

import filecmp
import re
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio import uploads
from materialist.studio.desk import keep, read_list, with_files

_STEMS = {"envmap": "light"}
"""Option -> what its files are called on the desk, where that is another word."""
_ADVICE = "give the zip that 'edits.yaml with its masks' makes"


def pack(steps: tuple[Step, ...], edits: Path, target: Path) -> None:
    """Write the list `edits` and every file that its steps name."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as made:
        for name in sorted({edits.name} | named(steps)):
            made.write(edits.parent / name, name)


def unpack(desk: Path, archive: Path) -> tuple[Step, ...]:
    """The steps of a zip that `pack` wrote, their files on the desk: under names of ours, where it lacks them.

    Only the list and the files that it names are read, each checked as an upload of its own is. Raises InputError.
    """
    shown = uploads.shown_name(archive.name)
    uploads.check_bytes(archive, shown)
    with tempfile.TemporaryDirectory(dir=desk, prefix=".load-") as place, uploads.readable_zip(shown, _ADVICE):
        folder = Path(place)
        with zipfile.ZipFile(archive) as given:
            members = {info.filename.replace("\\", "/"): info for info in given.infolist()[:10_000]}
            members = {name: info for name, info in members.items() if not name.startswith("__MACOSX/")}
            found = next((name for name in members if re.fullmatch(r"([^/]+/)?edits\.ya?ml", name)), None)
            if found is None:
                raise InputError(f"{shown} holds no edits.yaml; {_ADVICE}.")
            root = found.rpartition("edits")[0]

            def taken(name: str) -> Path:
                entry, file = members.get(root + name), folder / name
                if entry is None:
                    raise InputError(f"{shown} lacks the file {name}, which its list of edits names; {_ADVICE}.")
                if entry.file_size > uploads.MAX_MEGABYTES * 1e6:
                    raise InputError(
                        f"{name} in {shown} has {entry.file_size / 1e6:.0f} MB; the studio takes up to "
                        f"{uploads.MAX_MEGABYTES} MB a file."
                    )
                uploads.unpack_member(given, entry, file, shown)
                return file

            def moved(option: str, name: str) -> str:
                file = taken(name)
                suffix = (uploads.checked_mesh if option == "mesh" else uploads.checked_picture)(file, name)
                if (desk / name).is_file() and filecmp.cmp(desk / name, file, shallow=False):
                    return name
                return keep(desk, file, _STEMS.get(option, option), suffix)

            steps = read_list(taken(found.removeprefix(root)))
            total = sum(members[root + name].file_size for name in named(steps) if root + name in members)
            if total > uploads.MAX_UNPACKED:
                most = f"{uploads.MAX_UNPACKED / 1e9:g} GB"
                raise InputError(f"{shown} unpacks to {total / 1e9:.1f} GB; the studio takes up to {most}.")
            return tuple(replace(with_files(step, moved), folder=desk) for step in steps)


def named(steps: Iterable[Step]) -> set[str]:
    """The files that steps name."""
    names: set[str] = set()

    def noted(option: str, name: str) -> str:
        names.add(name)
        return name

    for step in steps:
        with_files(step, noted)
    return names
