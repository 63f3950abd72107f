"""Names of what is being written beside its place: hidden, and nobody else's, on another machine either."""

from __future__ import annotations

import os
import platform
import zlib
from pathlib import Path


def own() -> str:
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
    return path.with_name(f".partial-{own()}{path.suffix.lower() if suffix is None else suffix}")
