"""Files and folders that appear whole or not at all: written under a hidden name beside the target, then renamed.

A killed run leaves only `.NAME.HASH.partial-PID-MARK` (unfinished) or `.NAME.HASH.replaced-PID-MARK` (the old folder,
moved aside). The next write of a folder to the same target recognises both by name and removes them, unless their
process still runs here.
"""

import json
import os
import re
import secrets
import shutil
import threading
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from materialist.errors import OutputError
from materialist.io.native import name_problem

MARKER = "scene.json"
"""The file that makes a folder a scene package."""
_MAPS = r"(albedo|roughness|metallic|normal|depth)\.exr"
SCENE_FILES = re.compile(
    r"(scene\.json|report\.json|(photo|rerender)\.(exr|png)|envmap\.exr|mesh\.ply|plane_label\.png|overview\.png"
    rf"|(prior|maps)/{_MAPS}|prior/light\.exr|prior/(albedo|roughness|metallic|normal|depth)_spread\.exr|maps/shading_residual\.exr|bodies/\d+(\.ply|\.{_MAPS}))"
)
"""Files of a package, beside the photo as it was given."""
FILE_MANAGER_FILES = (".DS_Store", "Thumbs.db", "desktop.ini")
"""What file managers leave in folders."""
_MARK = secrets.token_hex(4)
"""Tells this process from those of the same number on other machines that share a folder."""


@dataclass(frozen=True)
class FolderKind:
    """Folders that `force` may replace: they hold a marker file, and nothing that the program did not write."""

    called: str
    marker: str | None
    is_member: Callable[[Path, str], bool]
    """(folder, name of a file below it) -> whether the program wrote it."""


def _is_scene_file(folder: Path, name: str) -> bool:
    """Whether a file is one of a package's, or the photo as it was given."""
    try:
        original = json.loads((folder / MARKER).read_text("utf-8"))["photo"]["original"]
    except (OSError, ValueError, KeyError, TypeError):
        original = "original.exr"
    return SCENE_FILES.fullmatch(name) is not None or name == original


SCENE = FolderKind("a scene package", MARKER, _is_scene_file)
FRAMES = FolderKind(
    "a folder of frames", None, lambda _, name: re.fullmatch(r"\d+\.png", name) is not None
)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it; the OSError says which file stands in the way, if one does."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        file = next((path for path in (folder, *folder.parents) if os.path.lexists(path)), folder)
        raise NotADirectoryError(error.errno, f"{file} is a file, not a folder") from error


def partial(path: Path, suffix: str | None = None) -> Path:
    """Where this thread writes PATH until it is whole; the suffix is PATH's, in small letters, unless one is given."""
    suffix = path.suffix.lower() if suffix is None else suffix
    return path.with_name(
        f"{_stem(path)}partial-{os.getpid()}-{_MARK}{threading.get_ident():x}{suffix}"
    )


@contextmanager
def writing(path: str | Path, temporary: Path | None = None) -> Iterator[None]:
    """Raise what goes wrong in the block as an OutputError that names PATH and not its temporary."""
    try:
        yield
    except OSError as error:
        raise OutputError(
            f"{path} cannot be written: {(error.strerror or str(error)).lower()}."
        ) from error
    except OutputError as error:
        raise OutputError(str(error).replace(str(temporary), str(path))) from error


def require_parent(path: str | Path) -> None:
    """Raise OutputError where the folder that PATH lies in is not there: its name may be misspelt."""
    # `lexists`: a broken link is there, too, and its error names it.
    parent = _absolute(path).parent
    if not os.path.lexists(parent):
        raise OutputError(
            f"There is no folder {parent} for {Path(path).name}; correct the name, or: mkdir -p {parent}"
        )


def ensure_writable(path: str | Path, force: bool = False, kind: FolderKind | None = SCENE) -> None:
    """Check before the work that a folder of `kind`, or with None a file, can be written at PATH.

    The folder that it lies in must be there, its name one that OpenEXR takes where EXRs are written.
    PATH must not exist, or with `force` be of the same kind: nothing else is
    ever replaced. Raises OutputError with the way out.
    """
    target = _absolute(path)
    needs_exr = kind is SCENE or target.suffix.lower() == ".exr"
    if needs_exr and (problem := name_problem(target)):
        raise OutputError(problem)
    with writing(path):
        if target.is_symlink() or target.exists():
            _require_replaceable(path, target, force, kind)
        require_parent(path)
        make_folder(target.parent)  # says which file stands in the way
        # The only sure test of permissions: write a file.
        probe = partial(target, ".probe")
        probe.touch()
        probe.unlink()


def _require_replaceable(
    path: str | Path, target: Path, force: bool, kind: FolderKind | None
) -> None:
    if kind is None and target.is_dir():
        raise OutputError(f"{path} is a folder; give a file's name.")
    if not force:
        raise OutputError(f"{path} exists; give `force=True` to replace it, or another name.")
    if target.is_symlink():
        raise OutputError(
            f"{path} is a link, which `force=True` will not replace; give what it leads to."
        )
    if kind is None:
        return
    # --- Is it a folder of this kind, or an empty one? ---
    marked = target.is_dir() and (
        kind.marker is None or (target / kind.marker).is_file() or not any(target.iterdir())
    )
    if not marked:
        raise OutputError(
            f"{path} is not {kind.called}, so `force=True` will not replace it; give another name."
        )
    # --- Nothing in it may be somebody else's ---
    for name in files_below(target):
        if not kind.is_member(target, name):
            raise OutputError(
                f"{path} holds {name}, which does not belong to {kind.called}, so `force=True` will not replace it; "
                "move that, or give another name."
            )


@contextmanager
def whole_file(path: str | Path, force: bool = False) -> Iterator[Path]:
    """Yield a temporary that becomes PATH when the block ends well, and vanishes when it does not."""
    ensure_writable(path, force, None)
    temporary = partial(Path(path))
    try:
        with writing(path, temporary):
            yield temporary
            os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def write_whole(path: str | Path, content: str | bytes, force: bool = True) -> None:
    """Write a file whole or not at all; with `force` in place of one that is there, its folder is made if missing.

    Raises OutputError.
    """
    if force:
        with writing(path):
            make_folder(_absolute(path).parent)
    with whole_file(path, force) as temporary:
        temporary.write_bytes(content.encode() if isinstance(content, str) else content)


@contextmanager
def whole_folder(path: str | Path, force: bool = False, kind: FolderKind = SCENE) -> Iterator[Path]:
    """Yield an empty temporary folder that becomes PATH when the block ends well, and vanishes when it does not."""
    ensure_writable(path, force, kind)
    target = _absolute(path)
    # What killed runs left is removed first: it may fill the disk.
    _sweep(target)
    temporary = partial(target, "")
    try:
        with writing(path, temporary):
            temporary.mkdir()
            yield temporary
            if target.is_symlink() or target.exists():  # it may have come in the meantime
                _require_replaceable(path, target, force, kind)
            _put_in_place(temporary, target)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def files_below(folder: Path) -> list[str]:
    """Names of the files in and below a folder, without those that file managers leave."""
    # A link counts as a file: what it leads to is not the program's.
    files = (file for file in folder.rglob("*") if file.is_symlink() or not file.is_dir())
    return sorted(
        file.relative_to(folder).as_posix() for file in files if file.name not in FILE_MANAGER_FILES
    )


def interrupted_replacement(path: str | Path) -> Path | None:
    """The old folder that a save killed at the worst moment left beside a PATH that is now missing, or None."""
    target = _absolute(path)
    if target.exists() or not target.parent.is_dir():
        return None
    return next(
        (
            p
            for p in sorted(target.parent.iterdir())
            if p.name.startswith(_stem(target) + "replaced-")
        ),
        None,
    )


def _put_in_place(temporary: Path, target: Path) -> None:
    """Rename into place; an old folder is moved aside first, and removed only when the new one is there."""
    if not target.exists():
        os.rename(temporary, target)
        return
    # Two renames, each atomic: at every moment the old or the new folder is whole.
    aside = target.with_name(f"{_stem(target)}replaced-{os.getpid()}-{_MARK}")
    os.rename(target, aside)
    try:
        os.rename(temporary, target)
    except BaseException:
        os.rename(aside, target)
        raise
    shutil.rmtree(aside, ignore_errors=True)


def _sweep(target: Path) -> None:
    """Remove what killed runs left; an old folder moved aside goes back when nothing has taken its place."""
    for leftover in sorted(target.parent.iterdir()):
        name = re.fullmatch(
            re.escape(_stem(target)) + r"(partial|replaced)-(\d+)\b.*", leftover.name
        )
        # Another running process may be writing the same target.
        if name is None or (psutil.pid_exists(int(name[2])) and int(name[2]) != os.getpid()):
            continue
        if name[1] == "replaced" and not target.exists():
            os.rename(leftover, target)
        else:
            shutil.rmtree(leftover, ignore_errors=True)


def _stem(target: Path) -> str:
    """Prefix of the temporaries of this target; short, so that a long name stays legal, and told apart by a hash."""
    return f".{target.name[:40]}.{zlib.crc32(os.fsencode(target.name)):08x}."


def _absolute(path: str | Path) -> Path:
    """PATH made absolute without following a link at its end; never the file-system root."""
    target = Path(os.path.abspath(path))
    if not target.name:
        raise OutputError(f"{path} is not a place for a result; give a name such as kitchen.scene.")
    return target
