"""The list of edits of a batch, for one photo of it: masks, textures and light by name."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path

from materialist.batch.packages import file_hash
from materialist.edit.recipe import Step, read_recipe

FILES = ("mask", "texture", "envmap")
"""Options of a step that name a file; `{name}` in them stands for the photo's name."""


def edits_for(path: str | Path, name: str) -> list[Step]:
    """The steps of a file (see docs/editing.md) with the photo's name put in. Raises InputError as `read_recipe`."""
    return [replace(step, options=_named(step.options, name)) for step in read_recipe(path)]


def edits_key(path: str | Path, name: str, spp: int) -> str:
    """SHA-256 (hex) of what the edited photo depends on beside the scene: steps, the files they name, samples."""
    described = []
    for step in edits_for(path, name):
        files = {key: _content(step, key) for key in FILES if isinstance(step.options.get(key), str)}
        described.append([step.kind, step.options, files])
    return hashlib.sha256(json.dumps([described, spp], sort_keys=True).encode()).hexdigest()


def _named(options: dict, name: str) -> dict:
    named = {k: v.replace("{name}", name) for k, v in options.items() if k in FILES and isinstance(v, str)}
    return {**options, **named}


def _content(step: Step, key: str) -> str | None:
    try:
        return file_hash(step.folder / step.options[key])
    except OSError:
        return None
