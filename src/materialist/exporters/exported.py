"""What an export is on disk: files, or a folder that says that it is one."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from materialist.io.atomic import FolderKind, files_below, whole_folder

MARKER = "materialist-export.json"
"""The file that makes a folder an export. It lists what was written."""


@dataclass(frozen=True)
class Exported:
    path: Path
    beside: tuple[Path, ...] = ()
    """Further files that belong to it."""
    notes: tuple[str, ...] = ()


def _is_listed(folder: Path, name: str) -> bool:
    try:
        return name == MARKER or name in json.loads((folder / MARKER).read_text("utf-8"))["files"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


EXPORT = FolderKind("an export", MARKER, _is_listed)


@contextmanager
def export_folder(path: Path, force: bool, to: str) -> Iterator[Path]:
    """Yield an empty folder that becomes the export PATH of the format `to` when the block ends well."""
    with whole_folder(path, force, EXPORT) as folder:
        yield folder
        content = {"format": to, "files": files_below(folder)}
        (folder / MARKER).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
