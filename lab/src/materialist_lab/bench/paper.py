"""`bench paper`: every table and ablation of the paper beside what this project measures, on one page.

`assets/paper.yaml` holds the paper's figures and what measures the same here: runs of the other benchmarks, each into
REPORT/runs/NAME, its figures into REPORT/rows/NAME.json. report.html and report.md are written after every run.
"""

import base64
import hashlib
import json
import os
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache, partial
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import yaml
from jinja2 import Environment

import materialist
from materialist.errors import MaterialistError
from materialist.io.atomic import make_folder, write_whole
from materialist.option_kinds import OperationOptions, option
from materialist.plain import plain
from materialist_lab.bench import benchmark_class
from materialist_lab.bench.benchmark import names, timed
from materialist_lab.bench.report import Column


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One run of another benchmark."""

    bench: str
    options: dict[str, Any]
    quick: dict[str, Any]
    full: dict[str, Any]
    needs: str = ""
    """A path that DIR must hold."""
    folder: str = ""
    """The part of DIR that is given."""

    def data(self, folder: Path | None) -> Path | None:
        """The folder that its benchmark is given, where it holds what that reads. Raises MaterialistError."""
        if self.needs and (folder is None or not (folder / self.needs).exists()):
            raise MaterialistError(f"Not run: it needs --data DIR with {self.needs}.")
        parts = (
            ()
            if self.needs
            else ("photos",)
            if self.options.get("photos")
            else ("meshes", "envmaps")
        )
        there = folder is not None and all((folder / name).is_dir() for name in parts)
        return folder / self.folder if folder is not None and there else None


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table or figure of the paper."""

    name: str
    """Its label in the paper."""
    title: str
    measure: str = ""
    paper: str = ""
    differs: str = ""
    columns: tuple[str, ...] = ()
    lines: list[tuple[Any, list[float | None], list[str]]] = field(default_factory=list)
    """(row, the paper's figures by column, names of our methods)."""
    absent: str = ""
    """Why nothing is measured."""

    def grid(self, columns: dict[str, Column], row: dict[str, Any]) -> Iterator[list[str]]:
        """The head of the table, then for every line the paper's figures and ours."""
        yield ["row", "method here", *(columns[key].title for key in self.columns), "samples"]
        means: dict[str, dict[str, float]] = row.get("means", {})
        for label, paper, methods in self.lines:
            if paper:
                entry = [*paper, *[None] * len(self.columns)][: len(self.columns)]
                yield [
                    str(label),
                    "published",
                    *("–" if x is None else f"{x:g}" for x in entry),
                    "",
                ]
            for method in filter(means.__contains__, methods):
                figures = [means[method].get(key) for key in self.columns]
                cells = (
                    "–" if x is None else f"{x:.{columns[k].digits}f}"
                    for k, x in zip(self.columns, figures)
                )
                yield [str(label), method, *cells, str(means[method]["samples"])]


@cache
def published() -> tuple[dict[str, Measure], list[Table]]:
    """What is measured, and the paper's tables in its order."""
    content = yaml.safe_load(
        (files("materialist_lab.bench") / "assets" / "paper.yaml").read_text("utf-8")
    )
    measures = {name: Measure(**entry) for name, entry in content["measures"].items()}
    return measures, [Table(**entry) for entry in content["tables"]]


@dataclass(frozen=True, kw_only=True)
class PaperBench(OperationOptions):
    """Run what can be run here, and write the page."""

    operation = "The benchmark"

    quick: bool = option(
        False, "Few and small samples: a quarter of an hour on two cores.", kind="switch"
    )
    resume: bool = option(
        False, "Keep the rows in REPORT that have this commit and these settings.", kind="switch"
    )
    only: str = option("", "Names of measures, with commas; empty for all.", kind="name")
    seed: int = option(0, "Same seed, same result.", kind="whole", low=0, high=2**31 - 1)
    device: str = option("auto", "Where it runs.", kind="word", choices=("auto", "cpu", "cuda"))

    def run(self, data: Path | None, output: Path) -> None:
        """Measure one row after the other; a row that cannot be says why. Raises InputError, OutputError."""
        measures, tables = published()
        chosen = names("measures", self.only or ",".join(measures), measures)
        make_folder(output / "rows")
        there = (output / "rows").glob("*.json") if self.resume else ()
        rows: dict[str, dict[str, Any]] = {
            path.stem: json.loads(path.read_text("utf-8")) for path in there
        }
        for name in chosen:
            try:
                rows[name] = self._row(name, measures[name], data, output, rows.get(name, {}))
            except MaterialistError as error:
                rows[name] = {"absent": str(error)}
            write_page(output, tables, measures, rows)

    def _row(
        self, name: str, measure: Measure, data: Path | None, output: Path, kept: dict[str, Any]
    ) -> dict[str, Any]:
        """The figures of a measure, kept or new. Raises MaterialistError."""
        place = measure.data(data)
        options = measure.options | (measure.quick if self.quick else measure.full)
        options |= {"seed": options.get("seed", 0) + self.seed, "device": self.device}
        key = plain(
            {
                "commit": commit(),
                "settings": {**options, "data": None if place is None else place.name},
            }
        )
        if kept.items() >= key.items():
            return kept
        folder = output / "runs" / name
        make_folder(folder)
        _, cost = timed(benchmark_class(measure.bench).merged(**options).run, place, folder)
        report = json.loads((folder / "report.json").read_text("utf-8"))
        row = {
            **key,
            **cost,
            "quick": self.quick,
            "machine": report["machine"],
            "means": report["means"],
        }
        write_whole(output / "rows" / f"{name}.json", json.dumps(row, indent=1))
        return row


@cache
def commit() -> str:
    """The last commit of product and laboratory, `+` and a digest where they have changes since.

    Of an installed package, which has no commits: "of version X".
    """
    released = f"of version {materialist.__version__}"
    folders = [str(Path(materialist.__file__).parent), str(Path(__file__).parents[1])]
    git: Any = partial(subprocess.run, cwd=folders[-1], capture_output=True, check=True)
    try:
        last, since = (
            git(["git", *words, "--", *folders]).stdout
            for words in (("log", "-1", "--format=%h"), ("diff", "HEAD"))
        )
    except (OSError, subprocess.CalledProcessError):
        return released
    return (last.decode().strip() or released) + (
        f"+{hashlib.sha256(since).hexdigest()[:6]}" if since else ""
    )


def write_page(
    output: Path, tables: list[Table], measures: dict[str, Measure], rows: dict[str, dict[str, Any]]
) -> None:
    """Write report.html, which opens without a server or other files, and report.md. Raises OutputError."""
    parts: list[dict[str, Any]] = []
    for table in tables:
        row: dict[str, Any] = rows.get(table.measure) or {"absent": _absence(table, measures)}
        columns = (
            {c.key: c for c in benchmark_class(measures[table.measure].bench).columns}
            if table.measure
            else {}
        )
        settings = ", ".join(
            f"{k} {v}" for k, v in row.get("settings", {}).items() if v is not None
        )
        first = all(part["table"].measure != table.measure for part in parts)
        picture = (
            _picture(output / "runs" / table.measure / "sheet.png")
            if first and "means" in row
            else ""
        )
        parts.append(
            {
                "table": table,
                "row": row,
                "grid": list(table.grid(columns, row)) if table.measure else [],
                "settings": settings,
                "picture": picture,
            }
        )
    entry = {
        "parts": parts,
        "cores": os.cpu_count(),
        "commit": commit(),
        "minutes": sum(row.get("seconds", 0) for row in rows.values()) / 60,
    }
    assets = files("materialist_lab.bench") / "assets"
    for kind in ("html", "md"):
        page = Environment(autoescape=kind == "html", trim_blocks=True, lstrip_blocks=True)
        text = page.from_string((assets / f"paper.{kind}").read_text("utf-8")).render(entry)
        write_whole(output / f"report.{kind}", text)


def _absence(table: Table, measures: dict[str, Measure]) -> str:
    """Why a table has no figures, and the command that makes them."""
    if table.absent:
        return table.absent
    needs = measures[table.measure].needs
    data = f" --data DIR with DIR/{needs}" if needs else ""
    return f"Not run yet: materialist bench paper -o REPORT --resume --only {table.measure}{data}."


def _picture(path: Path, widest: int = 1400) -> str:
    """A picture as a JPEG in a data URI, at most `widest` pixels across; empty where there is none."""
    picture = cv2.imread(str(path)) if path.is_file() else None
    if picture is None:
        return ""
    scale = min(1.0, widest / picture.shape[1])
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return (
        "data:image/jpeg;base64,"
        + base64.b64encode(cv2.imencode(".jpg", small)[1].tobytes()).decode()
    )
