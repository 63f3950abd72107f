"""index.html: the batch at a glance, in pages that hold their pictures and ask the network for nothing."""

from __future__ import annotations

import base64
import html
from importlib.resources import files
from pathlib import Path
from typing import Any

from materialist.batches.job import picture_path, scene_path, thumbnail_path
from materialist.batches.outcome import Outcome, Row
from materialist.batches.summary import replace_file

PER_PAGE = 200
"""Photos on one page; each adds 20 to 35 kB."""


def write_pages(outcome: Outcome) -> None:
    """Write index.html, and index-2.html, ... where there are many photos. Raises OutputError."""
    order = {"failed": 0, "done": 1, "open": 2}
    rows = sorted(outcome.rows, key=lambda row: order[row["status"]])  # what needs a look comes first
    pages = [rows[k : k + PER_PAGE] for k in range(0, len(rows), PER_PAGE)]
    for number, shown in enumerate(pages, 1):
        replace_file(outcome.runs / _file(number), page(outcome, shown, number, len(pages)).encode("utf-8"))


def page(outcome: Outcome, rows: list[Row], number: int = 1, pages: int = 1) -> str:
    """One page as text; everything that came from outside is escaped, and a policy in it forbids any request."""
    assets = files("materialist.batches") / "assets"
    edited = any(row["picture_hash"] for row in outcome.rows)
    values = {
        "title": html.escape(outcome.runs.resolve().name),
        "facts": _facts(outcome),
        "pictures": "photo, re-rendering, edit" if edited else "photo, re-rendering",
        "links": _links(number, pages),
        "cards": "".join(_card(outcome.runs, row) for row in rows),
        "style": (assets / "page.css").read_text("utf-8"),
    }
    # Split, not replaced one after the other: what a value holds is never read as a place for another.
    pieces = (assets / "page.html").read_text("utf-8").split("{{")
    rest = (piece.split("}}", 1) for piece in pieces[1:])
    return pieces[0] + "".join(values[name] + text for name, text in rest)


def _facts(outcome: Outcome) -> str:
    done = [row for row in outcome.rows if row["status"] == "done"]
    facts = [("photos", str(len(outcome.rows))), ("done", str(len(done))), ("failed", str(outcome.count("failed")))]
    if outcome.count("open"):
        facts.append(("not reached", str(outcome.count("open"))))
    quality = [row["psnr"] for row in done if row["psnr"] is not None]
    if quality:
        facts.append(("mean PSNR", f"{sum(quality) / len(quality):.1f} dB"))
    if done:
        facts.append(("a photo", f"{sum(row['seconds'] or 0 for row in done) / len(done):.1f} s"))
    return "".join(f"<div><dt>{name}</dt><dd>{html.escape(value)}</dd></div>" for name, value in facts)


def _links(number: int, pages: int) -> str:
    if pages == 1:
        return ""
    links = [
        f'<a href="{_file(k)}">{k}</a>' if k != number else f'<span aria-current="page">{k}</span>'
        for k in range(1, pages + 1)
    ]
    return f'<nav aria-label="Pages">{" ".join(links)}</nav>'


def _file(number: int) -> str:
    return "index.html" if number == 1 else f"index-{number}.html"


def _card(runs: Path, row: Row) -> str:
    name = html.escape(row["name"])
    head = f"<h2>{name}</h2><p class=place>{html.escape(row['id'])}</p>"
    if row["status"] == "failed":
        stage = f" (at: {html.escape(str(row['stage']))})" if row["stage"] else ""
        return f"<article class=failed>{head}<p class=reason>{html.escape(row['reason'] or '')}{stage}</p></article>"
    if row["status"] == "open":
        return f"<article class=open>{head}<p>Not reached.</p></article>"
    notes = "".join(f"<li>{html.escape(text)}</li>" for text in row["warnings"] or ())
    count = f"{len(row['warnings'] or ())} note{'s' * (len(row['warnings'] or ()) > 1)}"
    folded = f"<details><summary>{count}</summary><ul>{notes}</ul></details>" if notes else ""
    return f"<article>{_strip(runs, row)}{head}<p>{_figures(row)}</p>{_places(runs, row)}{folded}</article>"


def _figures(row: Row) -> str:
    figures: list[tuple[Any, str]] = [
        (row["psnr"], "{:.1f} dB"), (row["ssim"], "SSIM {:.3f}"), (row["seconds"], "{:.1f} s"),
    ]  # fmt: skip
    shown = [form.format(value) for value, form in figures if value is not None]
    if row["width"]:
        shown.append(f"{row['width']} × {row['height']}")
    if (row["attempts"] or 1) > 1:
        shown.append(f"{row['attempts']} attempts")
    return " · ".join(shown)


def _strip(runs: Path, row: Row) -> str:
    try:
        picture = base64.b64encode(thumbnail_path(runs, row["name"]).read_bytes()).decode()
    except OSError:
        return ""
    alt = "Photo, re-rendering" + (" and edit" if row["picture_hash"] else "")
    return f'<img src="data:image/jpeg;base64,{picture}" alt="{alt} of {html.escape(row["name"])}" loading="lazy">'


def _places(runs: Path, row: Row) -> str:
    """Links to the results, relative to the page."""
    from urllib.parse import quote

    scene = scene_path(runs, row["name"]).name
    links = [("all maps", f"{scene}/overview.png"), ("scene", f"{scene}/")]
    if row["picture_hash"]:
        links.insert(0, ("edited photo", picture_path(runs, row["name"]).name))
    return "<p class=links>" + " ".join(f'<a href="{quote(path)}">{text}</a>' for text, path in links) + "</p>"
