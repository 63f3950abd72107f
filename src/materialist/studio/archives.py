"""Zip files: edits.yaml with its files, made here and loaded for the same photo or another; and scene packages."""

import filecmp
import lzma
import re
import shutil
import tempfile
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from materialist.edits.recipe import Step, read_recipe
from materialist.errors import InputError
from materialist.io.atomic import SCENE_FILES
from materialist.studio import SETTINGS, uploads
from materialist.studio.workspace import with_plain_files

_MEMBER = re.compile(rf"{SCENE_FILES.pattern}|original\.[a-z0-9]{{1,5}}")
"""The files of a scene package; nothing else is unpacked."""
_UNREADABLE = (zipfile.BadZipFile, zlib.error, lzma.LZMAError, NotImplementedError, RuntimeError, EOFError, OSError)


def pack(steps: tuple[Step, ...], edits: Path, target: Path) -> None:
    """Write the list `edits` and every file that its steps name."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as made:
        for name in sorted({edits.name, *_named(steps)}):
            made.write(edits.parent / name, name)


def unpack(workspace: Path, archive: Path) -> tuple[Step, ...]:
    """The steps of a zip that `pack` wrote, their files in the workspace under names of ours.

    Only the list and the files that it names are read, each checked as an upload of its own is. Raises InputError.
    """
    shown = uploads.shown_name(archive)
    advice = "give the zip that 'edits.yaml with its masks' makes"
    with tempfile.TemporaryDirectory(dir=workspace, prefix=".load-") as place:
        folder = Path(place)
        with _members(archive, shown, r"edits\.ya?ml", f"no edits.yaml; {advice}") as (given, members):
            name = "edits.yaml" if "edits.yaml" in members else "edits.yml"
            _extract(given, {name: members[name]}, folder, shown)
            steps = read_recipe(folder / name)
            wanted = _named(steps)
            if lacking := sorted(wanted - {*members}):
                raise InputError(f"{shown} lacks the file {lacking[0]}, which its list of edits names; {advice}.")
            _extract(given, {name: members[name] for name in wanted}, folder, shown)

        def moved(option: str, name: str) -> str:
            file = folder / name
            if (workspace / name).is_file() and filecmp.cmp(workspace / name, file, shallow=False):
                return name
            return uploads.stored(workspace, file, option)

        return tuple(replace(with_plain_files(step, moved), folder=workspace) for step in steps)


def unpack_scene(archive: Path, target: Path) -> None:
    """Unpack a zipped scene package into `target`: known members only.

    Raises InputError for what is no zip, holds no scene, or would fill the disk; `target` is then left absent.
    """
    shown = uploads.shown_name(archive)
    missing = "no scene package (no scene.json); zip the folder that invert wrote"
    try:
        with _members(archive, shown, r"scene\.json", missing) as (given, members):
            _extract(given, {name: one for name, one in members.items() if _MEMBER.fullmatch(name)}, target, shown)
    except InputError:
        shutil.rmtree(target, ignore_errors=True)
        raise


@contextmanager
def _members(
    archive: Path, shown: str, marker: str, missing: str
) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """An open zip, and its members by name, from the folder in it that holds the marker (a regular expression).

    Raises InputError for what is no zip, and where there is no marker.
    """
    uploads.check_bytes(archive, shown)
    try:
        with zipfile.ZipFile(archive) as given:
            infos = given.infolist()[:10_000]
            names = [one.filename for one in infos if not one.filename.startswith("__MACOSX/")]
            found = next((name for name in names if re.fullmatch(rf"([^/]+/)?{marker}", name)), None)
            if found is None:
                raise InputError(f"{shown} holds {missing}.")
            root = found[: found.rfind("/") + 1]
            yield given, {one.filename[len(root) :]: one for one in infos if one.filename.startswith(root)}
    except _UNREADABLE as error:
        raise InputError(f"{shown} is not a readable zip file ({error}); zip it again.") from error


def _extract(given: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], folder: Path, shown: str) -> None:
    """Write members under their names here into a folder; `zipfile` reads no more of one than its header promises."""
    total = sum(entry.file_size for entry in members.values())
    if total > SETTINGS.unpacked_bytes:
        most = f"{SETTINGS.unpacked_bytes / 1e9:g} GB"
        raise InputError(f"{shown} unpacks to {total / 1e9:.1f} GB; the studio takes up to {most}.")
    for name, entry in members.items():
        entry.filename = name
        given.extract(entry, folder)


def _named(steps: Iterable[Step]) -> set[str]:
    """The files that steps name. Raises InputError for a name that is a path."""
    names: set[str] = set()
    for step in steps:
        with_plain_files(step, lambda _, name: names.add(name))
    return names
