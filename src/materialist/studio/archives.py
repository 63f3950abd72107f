"""Zip files: edits.yaml with its files, made here and loaded for the same photo or another; and scene packages."""

from __future__ import annotations

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

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio import SETTINGS, uploads
from materialist.studio.workspace import read_list, store, with_files

_STEMS = {"envmap": "light"}
"""Option -> the stem of its files in a workspace, where that is another word."""
_ADVICE = "give the zip that 'edits.yaml with its masks' makes"
_MEMBER = re.compile(
    r"(scene|report)\.json|(photo|rerender|overview|plane_label)\.png|(photo|rerender|envmap)\.exr|mesh\.ply|"
    r"original\.[a-z0-9]{1,5}|(prior|maps)/(albedo|roughness|metallic|normal|depth)\.exr|"
    r"bodies/\d{1,4}\.(ply|(albedo|roughness|metallic)\.exr)"
)
"""The files of a scene package; nothing else is unpacked."""


def pack(steps: tuple[Step, ...], edits: Path, target: Path) -> None:
    """Write the list `edits` and every file that its steps name."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as made:
        for name in sorted({edits.name} | named(steps)):
            made.write(edits.parent / name, name)


def unpack(workspace: Path, archive: Path) -> tuple[Step, ...]:
    """The steps of a zip that `pack` wrote, their files in the workspace: under names of ours, where it lacks them.

    Only the list and the files that it names are read, each checked as an upload of its own is. Raises InputError.
    """
    shown = uploads.shown_name(archive.name)
    uploads.check_bytes(archive, shown)
    with tempfile.TemporaryDirectory(dir=workspace, prefix=".load-") as place, readable_zip(shown, _ADVICE):
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
                if entry.file_size > SETTINGS.upload_megabytes * 1e6:
                    raise InputError(
                        f"{name} in {shown} has {entry.file_size / 1e6:.0f} MB; the studio takes up to "
                        f"{SETTINGS.upload_megabytes} MB a file."
                    )
                unpack_member(given, entry, file, shown)
                return file

            def moved(option: str, name: str) -> str:
                file = taken(name)
                suffix = (uploads.checked_mesh if option == "mesh" else uploads.checked_picture)(file, name)
                if (workspace / name).is_file() and filecmp.cmp(workspace / name, file, shallow=False):
                    return name
                return store(workspace, file, _STEMS.get(option, option), suffix)

            steps = read_list(taken(found.removeprefix(root)))
            total = sum(members[root + name].file_size for name in named(steps) if root + name in members)
            if total > SETTINGS.unpacked_bytes:
                most = f"{SETTINGS.unpacked_bytes / 1e9:g} GB"
                raise InputError(f"{shown} unpacks to {total / 1e9:.1f} GB; the studio takes up to {most}.")
            return tuple(replace(with_files(step, moved), folder=workspace) for step in steps)


def named(steps: Iterable[Step]) -> set[str]:
    """The files that steps name."""
    names: set[str] = set()

    def noted(option: str, name: str) -> str:
        names.add(name)
        return name

    for step in steps:
        with_files(step, noted)
    return names


def unpack_scene(archive: Path, target: Path, name: str) -> None:
    """Unpack a zipped scene package into `target`: known members only, under their own fixed names.

    Raises InputError for what is no zip, holds no scene, or would fill the disk; `target` is then left absent.
    """
    shown = uploads.shown_name(name)
    uploads.check_bytes(archive, shown)
    try:
        with readable_zip(shown, "zip the scene folder again"), zipfile.ZipFile(archive) as pack:
            members = _members(pack, shown)
            target.mkdir()
            for entry, inside in members:
                unpack_member(pack, entry, target / inside, shown)
    except InputError:
        shutil.rmtree(target, ignore_errors=True)
        raise


def _members(pack: zipfile.ZipFile, shown: str) -> list[tuple[zipfile.ZipInfo, str]]:
    """Members that belong to a package, with their place in it; the package may lie in a folder of the zip."""
    names = [info.filename for info in pack.infolist()[:10_000]]
    root = next((n.removesuffix("scene.json") for n in names if re.fullmatch(r"([^/]+/)?scene\.json", n)), None)
    if root is None:
        raise InputError(f"{shown} holds no scene package (no scene.json); zip the folder that invert wrote.")
    found = [
        (info, info.filename.removeprefix(root))
        for info in pack.infolist()
        if info.filename.startswith(root) and _MEMBER.fullmatch(info.filename.removeprefix(root))
    ]
    total = sum(info.file_size for info, _ in found)
    if total > SETTINGS.unpacked_bytes:
        most = f"{SETTINGS.unpacked_bytes / 1e9:g} GB"
        raise InputError(f"{shown} unpacks to {total / 1e9:.1f} GB; the studio takes up to {most}.")
    return found


def unpack_member(pack: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path, shown: str) -> None:
    """One member, never more than its header promises."""
    target.parent.mkdir(exist_ok=True)
    left = entry.file_size
    with pack.open(entry) as source, target.open("wb") as out:
        while block := source.read(1 << 20):
            left -= len(block)
            if left < 0:
                raise InputError(f"{shown} is not what its index says; zip it again.")
            out.write(block)


_DAMAGED = (zipfile.BadZipFile, zlib.error, lzma.LZMAError)
"""Errors of the packers of a zip."""


@contextmanager
def readable_zip(shown: str, advice: str) -> Iterator[None]:
    """Turn the errors of a zip file into an InputError that ends with the advice."""
    try:
        yield
    except (*_DAMAGED, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise InputError(f"{shown} is not a readable zip file ({error}); {advice}.") from error
