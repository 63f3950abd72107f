"""The outcome of a batch, its state while it runs, and the tables summary.csv and summary.json."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from materialist.batches.results import replace_file, together

COLUMNS = (
    "id", "name", "status", "reason", "psnr", "ssim", "seconds", "cpu_seconds", "invert_seconds", "edit_seconds",
    "peak_rss_mb", "width", "height", "fov", "predictor", "attempts", "scene_bytes", "scene_hash", "picture_hash",
    "photo_hash", "warnings",
)  # fmt: skip
"""Columns of the summary; a photo that failed has only the reason."""


@dataclass(frozen=True)
class Row:
    """One photo of a batch."""

    facts: dict[str, Any]
    """Keys of COLUMNS; status is `done`, `failed` or `open` (not reached)."""

    def __getitem__(self, key: str) -> Any:
        return self.facts.get(key)


@dataclass(frozen=True)
class Outcome:
    """The end of a batch."""

    runs: Path
    rows: tuple[Row, ...]
    """In the order of the photos' names in the source."""
    kept: int
    """How many were finished before this call."""
    seconds: float
    """Wall clock of this call."""
    options: dict[str, Any] = field(default_factory=dict)

    def count(self, status: str) -> int:
        """How many photos are `done`, `failed` or `open`."""
        return sum(row["status"] == status for row in self.rows)

    @property
    def hash(self) -> str:
        """Of all results: equal for equal photos and options, however many workers and interruptions there were."""
        done = [row for row in self.rows if row["status"] == "done"]
        return together((row["name"], f"{row['scene_hash']} {row['picture_hash'] or ''}") for row in done)

    @property
    def exit_code(self) -> int:
        """0 when every photo is done, 1 when one met a bug of ours, else 2."""
        if all(row["status"] == "done" for row in self.rows):
            return 0
        return 1 if any(row["bug"] for row in self.rows) else 2


@dataclass(frozen=True)
class Status:
    """A batch on its way."""

    total: int
    done: int
    """Including photos that an earlier call finished."""
    failed: int
    rate: float
    """Photos per second of this call; 0 while none is through."""
    left: float | None
    """Seconds to go at that rate; None while it is not known."""
    running: dict[str, str] = field(default_factory=dict)
    """Name -> stage, of photos at work."""
    news: str | None = None
    """A line to show; most are about a photo that has just ended."""
    urgent: bool = False
    """Whether the line is about something that went wrong."""


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
