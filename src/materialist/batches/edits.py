"""The list of edits of a batch, for one photo of it: masks, textures and light by name."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from materialist.batches.results import file_hash
from materialist.edits.glass.thickness import METHODS
from materialist.edits.insert.meshes import files_beside
from materialist.edits.recipe import Step, read_recipe

FILES = ("mask", "texture", "envmap", "mesh", "background", "thickness")
"""Options of a step that name a file, or a list of files; `{name}` in them stands for the photo's name."""


def edits_for(path: str | Path, name: str) -> list[Step]:
    """The steps of a file (see docs/editing.md) with the photo's name put in. Raises InputError as `read_recipe`."""
    return [replace(step, options=_named(step.options, name)) for step in read_recipe(path)]


def edits_key(path: str | Path, name: str, spp: int | None) -> str:
    """SHA-256 (hex) of what the edited photo depends on beside the scene: steps, the files they name, samples."""
    described = [
        [step.kind, step.options, [_content(file, key) for key, file in _files(step)]] for step in edits_for(path, name)
    ]
    return hashlib.sha256(json.dumps([described, spp], sort_keys=True).encode()).hexdigest()


def missing_files(path: str | Path, name: str) -> list[str]:
    """Files that the edits of a photo need and that are not there."""
    found = [file for step in edits_for(path, name) if not step.skipped for _, file in _files(step)]
    return [str(file) for file in found if not file.is_file()]


def _named(options: dict[str, Any], name: str) -> dict[str, Any]:
    def put(value: Any) -> Any:
        if isinstance(value, list):
            return [put(one) for one in value]
        return value.replace("{name}", name) if isinstance(value, str) else value

    return {key: put(value) if key in FILES else value for key, value in options.items()}


def _files(step: Step) -> Iterator[tuple[str, Path]]:
    """(option, file) of the files that a step names."""
    for key in FILES:
        value = step.options.get(key, [])
        for name in value if isinstance(value, list) else [value]:
            if isinstance(name, str) and not (key == "thickness" and name in METHODS):
                yield key, step.folder / name


def _content(file: Path, key: str) -> list[str] | None:
    """Hashes of a file and, of a mesh, of its materials and textures; None where it cannot be read."""
    try:
        return [file_hash(file), *(file_hash(other) for other in (files_beside(file) if key == "mesh" else ()))]
    except OSError:
        return None
