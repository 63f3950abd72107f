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
from typing import Any

from materialist.edits.recipe import MAX_BYTES, Step, read_recipe
from materialist.errors import InputError
from materialist.io.atomic import SCENE_FILES, writing
from materialist.io.image import write_png
from materialist.io.package import load_scene
from materialist.studio import SETTINGS, uploads
from materialist.studio.access.quota import Allowance, folder_size
from materialist.studio.stored import store
from materialist.studio.workspace import with_plain_files

_MEMBER = re.compile(rf"{SCENE_FILES.pattern}|original\.[a-z0-9]{{1,5}}")
"""The files of a scene package; nothing else is unpacked."""
_UNREADABLE = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    NotImplementedError,
    RuntimeError,
    EOFError,
    OSError,
)


def pack_edits(steps: tuple[Step, ...], edits: Path, target: Path) -> None:
    """Write the list `edits` and every file that its steps name."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in sorted({edits.name, *_named(steps)}):
            archive.write(edits.parent / name, name)


def unpack(workspace: Path, archive: Path, allowance: Allowance) -> tuple[Step, ...]:
    """The steps of a zip that `pack_edits` wrote, their files in the workspace under names of ours.

    Only the list and the files that it names are read, each checked as an upload of its own is.

    Raises InputError, OutputError.
    """
    # Unpacked beside the upload first: what is refused, or ended by a kill, leaves nothing in the workspace.
    with (
        writing(workspace),
        tempfile.TemporaryDirectory(dir=archive.parent, prefix=".load-") as place,
    ):
        folder = Path(place)
        steps, readable = uploads.opened_upload(extract_list, archive, allowance, folder=folder)

        def moved(option: str, name: str) -> str:
            file = folder / name
            if (workspace / name).is_file() and filecmp.cmp(workspace / name, file, shallow=False):
                return name
            content = readable[name].read_bytes()
            allowance.claim(len(content))
            return store(workspace, option, content, readable[name].suffix.lower())

        return tuple(replace(with_plain_files(step, moved), folder=workspace) for step in steps)


def unpack_scene(archive: Path, target: Path, allowance: Allowance) -> None:
    """Unpack a zipped scene package into `target`: known members only, and only a scene that can be loaded.

    Raises InputError for what is no zip, holds no scene, or would fill the disk; `target` is then left absent.
    """
    try:
        uploads.opened_upload(extract_scene, archive, allowance, target=target)
        allowance.claim(folder_size(target))
    except InputError:
        shutil.rmtree(target, ignore_errors=True)
        raise


# --- In the process with limits ---


def read_list(report: Any, file: Path) -> list[Step]:
    """The steps of a list of edits, a YAML file. Raises InputError."""
    return read_recipe(file)


def extract_list(report: Any, file: Path, folder: Path) -> tuple[list[Step], dict[str, Path]]:
    """The steps of a zipped list of edits, whose files it writes to a folder, and the file to read for each name."""
    shown = uploads.shown_name(file)
    advice = "give the zip that 'edits.yaml with its masks' makes"
    with _members(file, shown, r"edits\.ya?ml", f"no edits.yaml; {advice}") as (archive, members):
        name = "edits.yaml" if "edits.yaml" in members else "edits.yml"
        if members[name].file_size > MAX_BYTES:
            raise InputError(f"The {name} in {shown} is larger than 1 MB; shorten it.")
        _extract(archive, {name: members[name]}, folder, shown)
        steps = read_recipe(folder / name)
        options = _named(steps)
        # A list without its files could not be replayed.
        lacking = sorted(options.keys() - members.keys())
        if lacking:
            raise InputError(
                f"{shown} lacks the file {lacking[0]}, which its list of edits names; {advice}."
            )
        _extract(archive, {name: members[name] for name in options}, folder, shown)
    # Each file is checked as if it had been uploaded alone.
    readable = {
        name: uploads.checked_upload(report, folder / name, option)
        for name, option in options.items()
    }
    return steps, readable


def extract_scene(report: Any, file: Path, target: Path) -> None:
    """Unpack a zipped scene package and load it once. Raises InputError where it is damaged, or too large."""
    shown = uploads.shown_name(file)
    missing = "no scene package (no scene.json); zip the folder that invert wrote"
    with _members(file, shown, r"scene\.json", missing) as (archive, members):
        # Anything else in the zip stays packed.
        known = {name: info for name, info in members.items() if _MEMBER.fullmatch(name)}
        _extract(archive, known, target, shown)
    scene = load_scene(target, most=SETTINGS.decoded_bytes)
    camera = scene.camera
    if camera.width * camera.height > SETTINGS.scene_pixels:
        raise InputError(
            f"{shown} is a scene of {camera.width} x {camera.height} pixels; the studio takes up to "
            f"{SETTINGS.scene_pixels / 1e6:g} megapixels. Invert its photo again at a smaller --size."
        )
    height, width = scene.photo.original.shape[:2]
    if width * height > SETTINGS.upload_pixels:
        raise InputError(
            f"{shown} holds a photo of {width} x {height} pixels; the studio takes up to "
            f"{SETTINGS.upload_pixels / 1e6:g} megapixels. Shrink the photo, and invert it again."
        )
    # The server reads it, for the list of photos, and `load_scene` does not: it is written anew.
    write_png(target / "photo.png", scene.photo.linear)


@contextmanager
def _members(
    archive: Path, shown: str, marker: str, missing: str
) -> Iterator[tuple[zipfile.ZipFile, dict[str, zipfile.ZipInfo]]]:
    """An open zip, and its members by name, from the folder in it that holds the marker (a regular expression).

    Raises InputError for what is no zip, and where there is no marker.
    """
    try:
        with zipfile.ZipFile(archive) as opened:
            # A zip may promise millions of members; macOS adds a folder of its own.
            infos = opened.infolist()[:10_000]
            names = [info.filename for info in infos if not info.filename.startswith("__MACOSX/")]
            marker_name = next(
                (name for name in names if re.fullmatch(rf"([^/]+/)?{marker}", name)), None
            )
            if marker_name is None:
                raise InputError(f"{shown} holds {missing}.")
            root = marker_name[: marker_name.rfind("/") + 1]
            yield (
                opened,
                {
                    info.filename[len(root) :]: info
                    for info in infos
                    if info.filename.startswith(root)
                },
            )
    except _UNREADABLE as error:
        raise InputError(f"{shown} is not a readable zip file ({error}); zip it again.") from error


def _extract(
    archive: zipfile.ZipFile, members: dict[str, zipfile.ZipInfo], folder: Path, shown: str
) -> None:
    """Write members under their names here into a folder; `zipfile` reads no more of one than its header promises."""
    # By the promised sizes, before anything is written; `extract` reads no more than that.
    total = sum(entry.file_size for entry in members.values())
    if total > SETTINGS.unpacked_bytes:
        most = f"{SETTINGS.unpacked_bytes / 1e9:g} GB"
        raise InputError(f"{shown} unpacks to {total / 1e9:.1f} GB; the studio takes up to {most}.")
    folder.mkdir(parents=True, exist_ok=True)
    # Room for the others must stay.
    if shutil.disk_usage(folder).free - total < SETTINGS.disk_left:
        raise InputError(f"The disk of the studio has no room for {shown}.")
    for name, entry in members.items():
        entry.filename = name
        archive.extract(entry, folder)


def _named(steps: Iterable[Step]) -> dict[str, str]:
    """The files that steps name, and the option that names each. Raises InputError for a name that is a path."""
    options: dict[str, str] = {}
    for step in steps:
        with_plain_files(step, lambda option, name: options.setdefault(name, option))
    return options
