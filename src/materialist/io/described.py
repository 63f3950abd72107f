"""Folders of data that say in a JSON file what decided their content, so that two sets are never mixed."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from materialist.errors import InputError
from materialist.io.atomic import whole_file, writing


def claim(folder: Path, name: str, description: dict[str, Any], keys: Sequence[str]) -> None:
    """Make FOLDER, and write the description of its set to FOLDER/name.

    Raises InputError when FOLDER holds a set whose description differs in one of `keys`, or other things, OutputError
    when it cannot be written.
    """
    with writing(folder):
        if folder.is_dir() and any(folder.iterdir()):
            old = described(folder / name)
            if old is None:
                raise InputError(f"{folder} holds other things than such a set; name another folder.")
            for key in keys:
                if old.get(key) != description[key]:
                    raise InputError(
                        f"{folder} was begun with {key} {old.get(key)}, not {description[key]}; go on with that or "
                        "name another folder."
                    )
        with whole_file(folder / name, force=True) as file:
            file.write_text(json.dumps(description, indent=1) + "\n", "utf-8")


def described(file: Path) -> dict[str, Any] | None:
    """The description in a file; None where there is none, or a damaged one."""
    try:
        found = json.loads(file.read_text("utf-8"))
    except (FileNotFoundError, NotADirectoryError, ValueError):
        return None
    return found if isinstance(found, dict) else None
