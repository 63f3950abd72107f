"""What a batch came to, and how it stands while it runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from materialist.batches.packages import together

COLUMNS = (
    "id", "name", "status", "reason", "psnr", "ssim", "seconds", "cpu_seconds", "invert_seconds", "edit_seconds",
    "peak_rss_mb", "width", "height", "fov", "predictor", "attempts", "scene_bytes", "scene_hash", "picture_hash",
    "photo_hash", "warnings",
)  # fmt: skip
"""What the summary says of each photo; of a photo that failed there is only the reason."""


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
    """Including those that were finished before."""
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
