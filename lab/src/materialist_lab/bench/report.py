"""Reports of benchmarks: all rows as JSON, the means as a Markdown table, and a sheet of pictures."""

import json
import os
import platform
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from materialist.color import linear_to_srgb
from materialist.errors import OutputError
from materialist.io.atomic import make_folder, require_parent, write_whole, writing
from materialist.io.display import encoded
from materialist.plain import plain
from materialist.types import Array
from materialist_lab.data.sheets import write_sheet

CEILING = "ceiling"
"""In the method names of rows that are given the truth: they do not compete for the best figure."""


@dataclass(frozen=True)
class Column:
    """One figure of a benchmark."""

    key: str
    """Its name in the rows."""
    title: str
    better: str = ""
    """'higher', 'lower', or '' where neither is."""
    digits: int = 3


@dataclass(frozen=True)
class Report:
    """What a benchmark measured: one row a sample and method."""

    title: str
    note: str
    """What was done and how to read the figures: the text above the table."""
    settings: dict[str, Any]
    columns: tuple[Column, ...]
    rows: list[dict[str, Any]] = field(default_factory=list)
    """Dicts with 'method', 'sample' and the columns' keys; a figure that does not apply is absent."""
    sheet: list[Array] = field(default_factory=list)
    """Strips of pictures, uint8 [h, w, 3] sRGB, which sheet.png has under each other."""
    pictures: dict[str, Array] = field(default_factory=dict)
    """Name -> a larger picture, uint8 [h, w, 3] sRGB, which becomes pictures/NAME.png."""


def side_by_side(*pictures: Array) -> Array:
    """uint8 [H, n W, 3] sRGB: linear pictures [H, W, 3] side by side."""
    return np.round(linear_to_srgb(np.concatenate(pictures, 1)) * 255).astype(np.uint8)


def claim(folder: Path, *, force: bool = False) -> Path:
    """Make the folder for a report; raises OutputError when it holds something, unless `force`."""
    require_parent(folder)
    with writing(folder):
        if folder.is_dir() and any(folder.iterdir()) and not force:
            raise OutputError(
                f"{folder} is not empty; choose another folder, or add --force to write into it."
            )
        make_folder(folder)
    return folder


def write(report: Report, folder: Path) -> None:
    """Write report.json, report.md, sheet.png and pictures/; files of that run that are there are replaced.

    Raises OutputError where they cannot be written.
    """
    content = {
        "title": report.title,
        "settings": report.settings,
        "machine": {
            "cores": os.cpu_count(),
            "processor": platform.machine(),
            "python": platform.python_version(),
        },
        "means": means(report),
        "rows": report.rows,
    }
    write_whole(folder / "report.json", json.dumps(plain(content), indent=1))
    write_whole(folder / "report.md", markdown(report))
    write_sheet(report.sheet, folder / "sheet.png")
    if report.pictures:
        make_folder(folder / "pictures")
    for name, pixels in report.pictures.items():
        write_whole(folder / "pictures" / f"{name}.png", encoded(pixels))


def means(report: Report) -> dict[str, dict[str, float]]:
    """Mean of every column by method, in the order the methods were first met; infinite figures are left out."""
    result: dict[str, dict[str, float]] = {}
    for method in dict.fromkeys(row["method"] for row in report.rows):
        # Columns that no row of the method has stay empty.
        rows = [row for row in report.rows if row["method"] == method]
        result[method] = {"samples": len(rows)}
        for column in report.columns:
            values = [row[column.key] for row in rows if np.isfinite(row.get(column.key, np.nan))]
            if values:
                result[method][column.key] = float(np.mean(values))
    return result


def markdown(report: Report) -> str:
    """The content of report.md: the note and the table of means, the best figure of a column and part in bold."""
    table = means(report)
    arrow = {"higher": " ↑", "lower": " ↓", "": ""}
    head = ["method", "samples", *(c.title + arrow[c.better] for c in report.columns)]
    lines = [
        f"# {report.title}",
        "",
        report.note,
        "",
        "| " + " | ".join(head) + " |",
        "|---" * len(head) + "|",
    ]
    # --- The best of each column among the methods of one part; ceilings do not compete ---
    best: dict[tuple[str, str], float] = {}
    for c in report.columns:
        values: dict[str, list[float]] = {}
        for method, figures in table.items():
            if c.better and c.key in figures and CEILING not in method:
                values.setdefault(_part(method), []).append(figures[c.key])
        choose = max if c.better == "higher" else min
        best |= {
            (part, c.key): choose(values_of_part)
            for part, values_of_part in values.items()
            if len(values_of_part) > 1
        }
    for method, figures in table.items():
        cells = [method, str(int(figures["samples"]))]
        for c in report.columns:
            text = f"{figures[c.key]:.{c.digits}f}" if c.key in figures else "–"
            rival = CEILING not in method and c.key in figures
            winner = rival and figures[c.key] == best.get((_part(method), c.key))
            cells.append(f"**{text}**" if winner else text)
        lines.append("| " + " | ".join(cells) + " |")
    # --- What the run was called with ---
    settings = ", ".join(f"{k} {v}" for k, v in report.settings.items() if v is not None)
    return "\n".join([*lines, "", f"Settings: {settings}.", ""])


def _part(method: str) -> str:
    """What comes before the colon of a method's name, as an edit; only methods of one part compete."""
    return method.partition(":")[0] if ":" in method else ""
