"""summary.csv and summary.json: the batch as a table, for other programs."""

from __future__ import annotations

import csv
import io
import json
import os
from pathlib import Path
from typing import Any

from materialist.batches.outcome import COLUMNS, Outcome
from materialist.errors import OutputError


def write_summary(outcome: Outcome) -> None:
    """Write both into the folder of the batch, each whole or not at all. Raises OutputError."""
    replace_file(outcome.runs / "summary.csv", _csv(outcome).encode("utf-8"))
    replace_file(outcome.runs / "summary.json", (json.dumps(as_dict(outcome), indent=1) + "\n").encode())


def as_dict(outcome: Outcome) -> dict[str, Any]:
    """The content of summary.json."""
    return {
        "photos": len(outcome.rows),
        **{status: outcome.count(status) for status in ("done", "failed", "open")},
        "kept": outcome.kept,
        "seconds": round(outcome.seconds, 3),
        "photo_seconds": round(sum(row["seconds"] or 0 for row in outcome.rows), 3),
        "hash": outcome.hash,
        "options": outcome.options,
        "rows": [{key: row[key] for key in COLUMNS} for row in outcome.rows],
    }


def replace_file(path: Path, content: bytes) -> None:
    """Write a file whole or not at all. Raises OutputError."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        temporary.write_bytes(content)
        temporary.replace(path)
    except OSError as error:
        raise OutputError(f"{path} cannot be written: {error.strerror or error}.") from error


def _csv(outcome: Outcome) -> str:
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(COLUMNS)
    for row in outcome.rows:
        table.writerow([_cell(row[key]) for key in COLUMNS])
    return text.getvalue()


def _cell(value: Any) -> Any:
    """A value as a spreadsheet may read it: no text of ours or of a file's name can begin a formula."""
    if isinstance(value, list):
        value = " | ".join(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r") else value
