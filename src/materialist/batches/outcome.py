"""The outcome of a batch, its state while it runs, and its reports: summary.csv, summary.json and index.html."""

import csv
import hashlib
import io
import json
from dataclasses import dataclass, field
from importlib.resources import files
from pathlib import Path
from typing import Any

from materialist.batches.results import replace_file

COLUMNS = (
    "id", "name", "status", "reason", "psnr", "ssim", "seconds", "cpu_seconds", "invert_seconds", "edit_seconds",
    "peak_rss_mb", "width", "height", "fov", "predictor", "attempts", "scene_bytes", "scene_hash", "picture_hash",
    "photo_hash", "warnings",
)  # fmt: skip
"""Columns of the summary; a photo that failed has only the reason."""


class Row(dict[str, Any]):
    """One photo of a batch: values by COLUMNS. `status` is `done`, `failed` or `open` (not reached)."""

    def __missing__(self, key: str) -> None:
        return None


@dataclass(frozen=True)
class Outcome:
    runs: Path
    rows: tuple[Row, ...]
    """In the order of the photos' names in the source."""
    kept: int
    seconds: float
    """Wall clock of this call."""
    options: dict[str, Any] = field(default_factory=dict)

    def of(self, status: str) -> list[Row]:
        return [row for row in self.rows if row["status"] == status]

    def count(self, status: str) -> int:
        return len(self.of(status))

    @property
    def hash(self) -> str:
        """Of all results: equal for equal photos and options, however many workers and interruptions there were."""
        results = sorted((row["name"], f"{row['scene_hash']} {row['picture_hash'] or ''}") for row in self.of("done"))
        return hashlib.sha256("\n".join(f"{name} {value}" for name, value in results).encode()).hexdigest()

    @property
    def exit_code(self) -> int:
        """0 when every photo is done, 1 when one met a bug of ours, else 2."""
        if self.count("done") == len(self.rows):
            return 0
        return 1 if any(row["bug"] for row in self.rows) else 2


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
    replace_file(outcome.runs / "summary.csv", text.getvalue().encode("utf-8"))
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
    replace_file(outcome.runs / "summary.json", (json.dumps(summary, indent=1) + "\n").encode())


def _cell(value: Any) -> Any:
    """A value for a spreadsheet: no text of ours or of a file's name can begin a formula."""
    if isinstance(value, list):
        value = " | ".join(value)
    if isinstance(value, float):
        return f"{value:.6g}"
    return f"'{value}" if isinstance(value, str) and value[:1] in ("=", "+", "-", "@", "\t", "\r") else value


def write_page(outcome: Outcome) -> None:
    """Write index.html, which shows the thumbnails and opens without a server. Raises OutputError.

    The template escapes whatever came from outside, and a policy in it forbids requests to other places.
    """
    from jinja2 import Environment

    assets = files("materialist.batches") / "assets"
    template = Environment(autoescape=True).from_string((assets / "page.html").read_text("utf-8"))
    order = {"failed": 0, "done": 1, "open": 2}
    rows = sorted(outcome.rows, key=lambda row: order[row["status"]])  # what needs a look comes first
    page = template.render(
        title=outcome.runs.resolve().name, style=(assets / "page.css").read_text("utf-8"), facts=_facts(outcome),
        edited=any(row["picture_hash"] for row in outcome.rows), cards=[_card(row) for row in rows],
    )  # fmt: skip
    replace_file(outcome.runs / "index.html", page.encode("utf-8"))


def _facts(outcome: Outcome) -> list[tuple[str, str]]:
    done = outcome.of("done")
    facts = [("photos", str(len(outcome.rows))), ("done", str(len(done))), ("failed", str(outcome.count("failed")))]
    if outcome.count("open"):
        facts.append(("not reached", str(outcome.count("open"))))
    quality = [row["psnr"] for row in done if row["psnr"] is not None]
    if quality:
        facts.append(("mean PSNR", f"{sum(quality) / len(quality):.1f} dB"))
    if done:
        facts.append(("a photo", f"{sum(row['seconds'] or 0 for row in done) / len(done):.1f} s"))
    return facts


def _card(row: Row) -> dict[str, Any]:
    """Values of the template for one photo; links are relative to the page."""
    if row["status"] != "done":
        return {"row": row}
    figures: list[tuple[Any, str]] = [
        (row["psnr"], "{:.1f} dB"), (row["ssim"], "SSIM {:.3f}"), (row["seconds"], "{:.1f} s"),
    ]  # fmt: skip
    shown = [form.format(value) for value, form in figures if value is not None]
    shown += [f"{row['width']} × {row['height']}"] if row["width"] else []
    shown += [f"{row['attempts']} attempts"] if (row["attempts"] or 1) > 1 else []
    name = row["name"]
    links = [("all maps", f"{name}.scene/overview.png"), ("scene", f"{name}.scene/")]
    if row["picture_hash"]:
        links.insert(0, ("edited photo", f"{name}.png"))
    return {"row": row, "figures": " · ".join(shown), "links": links, "thumbnail": f"thumbs/{name}.jpg"}
