"""Exports appear whole or not at all: written beside their place, then renamed."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from materialist.errors import OutputError
from materialist.io.atomic import files_below, make_folder, process_tag

MARKER = "materialist-export.json"
"""The file that makes a folder an export: nothing else is ever replaced. It lists what was written."""


def ensure_free(path: Path, force: bool, *, folder: bool) -> None:
    """Raise OutputError unless PATH can be written: it is free, or `force` and of the kind it would be replaced by.

    An export's folder is replaced only where it holds nothing but what was written there.
    """
    try:
        if path.is_symlink() or path.exists():
            if not force:
                raise OutputError(f"{path} exists; give --force to replace it, or another name.")
            if path.is_symlink() or path.is_dir() != folder:
                kind = "a folder" if folder else "a file"
                raise OutputError(f"{path} is not {kind}, so --force will not replace it; give another name.")
            if folder and any(path.iterdir()) and not (path / MARKER).is_file():
                raise OutputError(f"{path} is no export, so --force will not replace it; give another name.")
            if folder and (reason := _not_ours(path)):
                raise OutputError(f"{path} {reason}, so --force will not replace it; move that, or give another name.")
        make_folder(path.absolute().parent)
        probe = _beside(path, "probe")
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {_reason(error)}.") from error


@contextmanager
def whole_files(paths: list[Path], force: bool = False) -> Iterator[list[Path]]:
    """Yield a temporary for every path; they get their names when the block ends well, and vanish when it does not."""
    for path in paths:
        ensure_free(path, force, folder=False)
    # The suffix stays last: some writers choose the format by it.
    temporaries = [_beside(path, "partial", path.suffix) for path in paths]
    try:
        yield temporaries
        for temporary, path in zip(temporaries, paths):
            os.replace(temporary, path)
    except OSError as error:
        raise OutputError(f"{paths[0]} cannot be written: {_reason(error)}.") from error
    finally:
        for temporary in temporaries:
            temporary.unlink(missing_ok=True)


@contextmanager
def whole_folder(path: Path, force: bool = False, **facts: object) -> Iterator[Path]:
    """Yield an empty folder that becomes PATH when the block ends well; `facts` go into its marker file."""
    ensure_free(path, force, folder=True)
    temporary, aside = _beside(path, "partial"), _beside(path, "replaced")
    try:
        temporary.mkdir()
        yield temporary
        facts = {**facts, "files": files_below(temporary)}
        (temporary / MARKER).write_text(json.dumps(facts, indent=1) + "\n", "utf-8")
        if path.exists():
            os.rename(path, aside)
        try:
            os.rename(temporary, path)
        except BaseException:
            if aside.exists():
                os.rename(aside, path)
            raise
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {_reason(error)}.") from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        if path.exists():  # else the old one is still aside, and is all there is
            shutil.rmtree(aside, ignore_errors=True)


def _not_ours(folder: Path) -> str:
    """Why an export's folder may hold something that it did not write, "" where it does not."""
    if not (folder / MARKER).is_file():  # an empty folder
        return ""
    try:
        known = json.loads((folder / MARKER).read_text("utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return "was written by a version that did not list its files"
    name = next((name for name in files_below(folder) if name not in known and name != MARKER), "")
    return f"holds {name}, which no export wrote" if name else ""


def _beside(path: Path, kind: str, suffix: str = "") -> Path:
    return path.absolute().with_name(f".{path.name[:40]}.{kind}-{process_tag()}{suffix}")


def _reason(error: OSError) -> str:
    return (error.strerror or str(error)).lower()
