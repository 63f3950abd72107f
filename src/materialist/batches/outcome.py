"""The outcome of a batch, its state while it runs, and its reports: summary.csv, summary.json and index.html."""

import csv
import hashlib
import io
import json
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from materialist.io.atomic import write_whole

COLUMNS = (
    "id",
    "name",
    "status",
    "reason",
    "psnr",
    "ssim",
    "seconds",
    "cpu_seconds",
    "invert_seconds",
    "edit_seconds",
    "peak_rss_mb",
    "width",
    "height",
    "fov",
    "predictor",
    "attempts",
    "scene_bytes",
    "scene_hash",
    "picture",
    "picture_hash",
    "photo_hash",
    "warnings",
)
"""Columns of the summary; a photo that failed has only the reason."""


Row = dict[str, Any]
"""One photo of a batch: values by COLUMNS, None where there is none. `status` is done, failed or open (not reached)."""


@dataclass(frozen=True)
class Outcome:
    runs: Path
    rows: tuple[Row, ...]
    """In the order of the photos' names in the source."""
    kept: int
    seconds: float
    """Wall clock of this call."""
    options: dict[str, Any] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    """What of the source was passed over."""

    def of(self, status: str) -> list[Row]:
        return [row for row in self.rows if row["status"] == status]

    def count(self, status: str) -> int:
        return len(self.of(status))

    @property
    def hash(self) -> str:
        """Of all results: equal for equal photos and options, however many workers and interruptions there were."""
        results = sorted(
            (row["name"], f"{row['scene_hash']} {row['picture_hash'] or ''}")
            for row in self.of("done")
        )
        return hashlib.sha256(
            "\n".join(f"{name} {value}" for name, value in results).encode()
        ).hexdigest()

    @property
    def exit_code(self) -> int:
        """0 when every photo is done, 1 when one met a bug of ours, else 2."""
        if self.count("done") == len(self.rows):
            return 0
        return 1 if any(row.get("bug") for row in self.rows) else 2


@dataclass(frozen=True)
class Status:
    total: int
    done: int
    """Including photos that an earlier call finished."""
    failed: int
    running: dict[str, str] = field(default_factory=dict)
    """Name -> stage, of photos at work."""
    news: str | None = None
    """A line to show; most are about a photo that has just ended."""


def write_summary(outcome: Outcome) -> None:
    """Write both tables into the folder of the batch, each whole or not at all. Raises OutputError."""
    text = io.StringIO()
    table = csv.writer(text)
    table.writerow(COLUMNS)
    table.writerows([_cell(row[key]) for key in COLUMNS] for row in outcome.rows)
    write_whole(outcome.runs / "summary.csv", text.getvalue().encode("utf-8"))
    summary = {
        "photos": len(outcome.rows),
        **{status: outcome.count(status) for status in ("done", "failed", "open")},
        "kept": outcome.kept,
        "seconds": round(outcome.seconds, 3),
        "photo_seconds": round(sum(row["seconds"] or 0 for row in outcome.rows), 3),
        "hash": outcome.hash,
        "options": outcome.options,
        "rows": [{key: row[key] for key in COLUMNS} for row in outcome.rows],
    }
    write_whole(outcome.runs / "summary.json", (json.dumps(summary, indent=1) + "\n").encode())


def _cell(value: Any) -> Any:
    """A value for a spreadsheet: no text of ours or of a file's name can begin a formula."""
    if isinstance(value, list):
        value = " | ".join(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return (
        f"'{value}"
        if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r")
        else value
    )


def write_page(outcome: Outcome) -> None:
    """Write index.html, which shows the thumbnails and opens without a server. Raises OutputError.

    The template escapes whatever came from outside, and a policy in it forbids requests to other places.
    """
    from jinja2 import Environment

    assets = files("materialist.batches") / "assets"
    template = Environment(autoescape=True).from_string((assets / "page.html").read_text("utf-8"))
    order = {"failed": 0, "done": 1, "open": 2}
    rows = sorted(
        outcome.rows, key=lambda row: order[row["status"]]
    )  # what needs a look comes first
    page = template.render(
        title=outcome.runs.resolve().name,
        style=(assets / "page.css").read_text("utf-8"),
        outcome=outcome,
        rows=rows,
    )
    write_whole(outcome.runs / "index.html", page.encode("utf-8"))
