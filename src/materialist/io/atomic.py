"""Files and folders that appear whole or not at all: written under a hidden name beside the target, then renamed.

A killed run leaves only `.NAME.HASH.partial-PID-HOST` (unfinished) or `.NAME.HASH.replaced-PID-HOST` (the old scene,
moved aside). The next save to the same target recognises both by name and removes them, unless their process still
runs. A process of another machine cannot be asked, so its folders stay for a day.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from materialist.errors import OutputError

MARKER = "scene.json"
"""The file that makes a folder a scene package."""
_MAPS = r"(albedo|roughness|metallic|normal|depth)\.exr"
MEMBERS = re.compile(
    r"(scene\.json|report\.json|(photo|rerender)\.(exr|png)|envmap\.exr|mesh\.ply|plane_label\.png|overview\.png"
    rf"|(prior|maps)/{_MAPS}|bodies/\d+(\.ply|\.{_MAPS}))"
)
"""Files of a package, beside the photo as it was given."""
JUNK = (".DS_Store", "Thumbs.db", "desktop.ini")
"""What file managers leave in folders."""
KEPT_FOR = 24 * 3600
"""Seconds for which another machine's unfinished folder is left alone."""


def process_tag() -> str:
    """`PID-HOST`: this process among those of all machines (containers) that may share a folder."""
    return f"{os.getpid()}-{host()}"


def host() -> str:
    """Eight hexadecimal digits for this machine's name."""
    return f"{zlib.crc32(os.fsencode(platform.node())):08x}"


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; the OSError says which file stands in the way, if one does."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next((path for path in (folder, *folder.parents) if os.path.lexists(path)), folder)
        raise NotADirectoryError(error.errno, f"{file} is a file, not a folder") from error


def partial(path: Path, suffix: str | None = None) -> Path:
    """Where PATH is written until it is whole; the suffix stays PATH's, in small letters, unless another is given."""
    return path.with_name(f".partial-{process_tag()}{path.suffix.lower() if suffix is None else suffix}")


def ensure_writable(path: str | Path, force: bool = False) -> None:
    """Check that a scene can be written at PATH; call it before the fit. Raises OutputError with the way out.

    PATH must not exist, or with `force` be a scene package or an empty folder: nothing else is ever replaced.
    """
    target = _absolute(path)
    probe = _sibling(target, "probe")
    try:
        if target.is_symlink() or target.exists():
            _require_replaceable(path, target, force)
        make_folder(target.parent)
        probe.mkdir()
        probe.rmdir()
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {_reason(error)}.") from error


@contextmanager
def whole_folder(path: str | Path, force: bool = False) -> Iterator[Path]:
    """Yield an empty temporary folder that becomes PATH when the block ends well, and vanishes when it does not."""
    ensure_writable(path, force)
    target = _absolute(path)
    _sweep(target)
    temporary = _sibling(target, "partial")
    try:
        temporary.mkdir()
        yield temporary
        if target.is_symlink() or target.exists():  # it may have come in the meantime
            _require_replaceable(path, target, force)
        _put_in_place(temporary, target)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {_reason(error)}.") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _require_replaceable(path: str | Path, target: Path, force: bool) -> None:
    """Refuse an existing target without `force`, and anything but a scene package or an empty folder with it."""
    if not force:
        raise OutputError(f"{path} exists; give --force to replace it, or another name.")
    if target.is_symlink() or not target.is_dir() or (any(target.iterdir()) and not (target / MARKER).is_file()):
        raise OutputError(f"{path} is not a scene package, so --force will not replace it; give another name.")
    if name := next((name for name in files_below(target) if name != _original(target) and not _is_member(name)), ""):
        raise OutputError(
            f"{path} holds {name}, which is no part of a scene, so --force will not replace it; move that, or give "
            "another name."
        )


def files_below(folder: Path) -> list[str]:
    """Names of the files in and below a folder, without those that file managers leave."""
    files = (file for file in folder.rglob("*") if file.is_symlink() or not file.is_dir())
    return sorted(file.relative_to(folder).as_posix() for file in files if file.name not in JUNK)


def _is_member(name: str) -> bool:
    return MEMBERS.fullmatch(name) is not None


def _original(folder: Path) -> str:
    """The name of the photo as it was given in a package."""
    try:
        return str(json.loads((folder / MARKER).read_text("utf-8"))["photo"]["original"])
    except (OSError, ValueError, KeyError, TypeError):
        return "original.exr"


def interrupted_replacement(path: str | Path) -> Path | None:
    """The old scene that a save killed at the worst moment left beside a PATH that is now missing, or None."""
    target = _absolute(path)
    if target.exists() or not target.parent.is_dir():
        return None
    return next((p for p in sorted(target.parent.iterdir()) if p.name.startswith(_stem(target) + "replaced-")), None)


def _put_in_place(temporary: Path, target: Path) -> None:
    """Rename into place; an old scene is moved aside first, and removed only when the new one is there."""
    if not target.exists():
        os.rename(temporary, target)
        return
    aside = _sibling(target, "replaced")
    os.rename(target, aside)
    try:
        os.rename(temporary, target)
    except BaseException:
        os.rename(aside, target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _sweep(target: Path) -> None:
    """Remove what killed runs left; an old scene moved aside goes back when nothing has taken its place."""
    for leftover in sorted(target.parent.iterdir()):
        kind, _, owner = leftover.name.removeprefix(_stem(target)).partition("-")
        process, _, machine = owner.partition("-")
        if not leftover.name.startswith(_stem(target)) or not process.isdigit() or _in_use(leftover, process, machine):
            continue
        if kind == "replaced" and not target.exists():
            os.rename(leftover, target)
        else:
            shutil.rmtree(leftover, ignore_errors=True)


def _in_use(leftover: Path, process: str, machine: str) -> bool:
    if machine not in ("", host()):
        return time.time() - leftover.stat().st_ctime < KEPT_FOR
    return psutil.pid_exists(int(process)) and int(process) != os.getpid()


def _stem(target: Path) -> str:
    """Prefix of the temporaries of this target; short, so that a long name stays legal, and told apart by a hash."""
    return f".{target.name[:40]}.{zlib.crc32(os.fsencode(target.name)):08x}."


def _sibling(target: Path, kind: str) -> Path:
    return target.with_name(f"{_stem(target)}{kind}-{process_tag()}")


def _absolute(path: str | Path) -> Path:
    """PATH made absolute without following a link at its end; never the file-system root."""
    target = Path(os.path.abspath(path))
    if not target.name:
        raise OutputError(f"{path} is not a place for a scene; give a folder name such as kitchen.scene.")
    return target


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
