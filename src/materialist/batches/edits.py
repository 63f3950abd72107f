"""The list of edits of a batch, for one photo of it: masks, textures and light by name."""

import hashlib
import json
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

from materialist.batches.results import file_hash

if TYPE_CHECKING:
    from materialist.edits.recipe import Step
# The editing packages take seconds to import; a batch without edits does without.


def edits_for(path: str | Path, name: str) -> "list[Step]":
    """The steps of a file (see docs/editing.md) with the photo's name for `{name}` in the names of files.

    Raises InputError as `read_recipe`.
    """
    from materialist.edits.recipe import with_files

    def put(_, value):
        return value.replace("{name}", name) if isinstance(value, str) else value

    return [
        with_files(step, put)
        for step in _steps(path, Path(path).read_bytes() if Path(path).is_file() else b"")
    ]


def check_edits(path: str | Path) -> None:
    """Raise InputError where the list cannot be read, SetupError where a library that a step needs is missing."""
    from materialist.edits.recipe import check_libraries

    check_libraries(edits_for(path, ""))


@lru_cache(maxsize=1)
def _steps(path: str | Path, content: bytes) -> "list[Step]":
    """The steps of a file with this content, parsed once for all photos."""
    from materialist.edits.recipe import read_recipe

    return read_recipe(path)


def edits_key(path: str | Path, name: str, spp: int, quality: int | None = None) -> str:
    """SHA-256 (hex) of what the edited photo depends on beside the scene: steps, the files they name, samples, and
    how well it is encoded."""
    described = [
        [step.kind, step.options, [_content(file, key) for key, file in _files(step)]]
        for step in edits_for(path, name)
    ]
    return hashlib.sha256(
        json.dumps(
            [described, spp, *([] if quality is None else [quality])], sort_keys=True
        ).encode()
    ).hexdigest()


def missing_files(path: str | Path, name: str) -> list[str]:
    """Files that the edits of a photo need and that are not there."""
    files = [file for step in edits_for(path, name) if not step.skipped for _, file in _files(step)]
    return [str(file) for file in files if not file.is_file()]


def _files(step: "Step") -> list[tuple[str, Path]]:
    from materialist.edits.recipe import with_files

    named: list[tuple[str, str]] = []
    with_files(step, lambda option, name: named.append((option, name)))
    return [(option, step.folder / name) for option, name in named if isinstance(name, str)]


def _content(file: Path, key: str) -> list[str] | None:
    """Hashes of a file and, of a mesh, of its materials and textures; None where it cannot be read."""
    from materialist.edits.insert.meshes import files_beside

    try:
        return [
            file_hash(file),
            *(file_hash(other) for other in (files_beside(file) if key == "mesh" else ())),
        ]
    except OSError:
        return None
