"""The list of edits of a batch, for one photo of it: masks, textures and light by name."""

from __future__ import annotations

import hashlib
import json
import os
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


def edits_key(path: str | Path, name: str, spp: int) -> str:
    """SHA-256 (hex) of what the edited photo depends on beside the scene: steps, the files they name, samples."""
    described = []
    for step in edits_for(path, name):
        files = {
            key: [_content(step, key, file) for file in _list(step.options[key])]
            for key in FILES
            if key in step.options
        }
        described.append([step.kind, step.options, files])
    return hashlib.sha256(json.dumps([described, spp], sort_keys=True).encode()).hexdigest()


def missing_files(steps: list[Step], name: str) -> list[str]:
    """Files that steps as `read_recipe` gives them need for a photo and that are not there."""
    found = []
    for step in steps:
        if step.skipped:
            continue
        options = _named(step.options, name)
        given = [(key, file) for key in FILES if key in options for file in _list(options[key])]
        files = [f for key, f in given if isinstance(f, str) and not (key == "thickness" and f in METHODS)]
        found += [str(step.folder / file) for file in files if not os.path.isfile(step.folder / file)]
    return found


def _named(options: dict, name: str) -> dict:
    put = lambda value: value.replace("{name}", name) if isinstance(value, str) else value  # noqa: E731
    named = {k: [put(one) for one in v] if isinstance(v, list) else put(v) for k, v in options.items() if k in FILES}
    return {**options, **named}


def _content(step: Step, key: str, file: Any) -> str | list[str] | None:
    """Hash of a file; of a mesh, also the hashes of its materials and textures."""
    path = step.folder / str(file)
    try:
        beside = [file_hash(other) for other in files_beside(path)] if key == "mesh" else []
        return [file_hash(path), *beside] if beside else file_hash(path)
    except OSError:
        return None


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]
