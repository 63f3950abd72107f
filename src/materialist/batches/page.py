"""index.html: the batch in pages that hold their pictures and ask the network for nothing."""

from __future__ import annotations

import base64
from importlib.resources import files
from pathlib import Path
from typing import Any

from materialist.batches.outcome import Outcome, Row
from materialist.batches.results import picture_path, replace_file, scene_path, thumbnail_path

PER_PAGE = 200
"""Photos on one page; each adds 20 to 35 kB."""


def write_pages(outcome: Outcome) -> None:
    """Write index.html, and index-2.html, ... where there are many photos. Raises OutputError.

    The template escapes whatever came from outside, and a policy in it forbids any request.
    """
    from jinja2 import Environment

    assets = files("materialist.batches") / "assets"
    template = Environment(autoescape=True).from_string((assets / "page.html").read_text("utf-8"))
    order = {"failed": 0, "done": 1, "open": 2}
    rows = sorted(outcome.rows, key=lambda row: order[row["status"]])  # what needs a look comes first
    chunks = [rows[k : k + PER_PAGE] for k in range(0, len(rows), PER_PAGE)]
    names = ["index.html", *(f"index-{k}.html" for k in range(2, len(chunks) + 1))]
    for number, chunk in enumerate(chunks, 1):
        page = template.render(
            title=outcome.runs.resolve().name, style=(assets / "page.css").read_text("utf-8"), facts=_facts(outcome),
            edited=any(row["picture_hash"] for row in outcome.rows), pages=names, number=number,
            cards=[_card(outcome.runs, row) for row in chunk],
        )  # fmt: skip
        replace_file(outcome.runs / names[number - 1], page.encode("utf-8"))


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


def _card(runs: Path, row: Row) -> dict[str, Any]:
    """Values of the template for one photo; links are relative to the page."""
    if row["status"] != "done":
        return {"row": row}
    figures: list[tuple[Any, str]] = [
        (row["psnr"], "{:.1f} dB"), (row["ssim"], "SSIM {:.3f}"), (row["seconds"], "{:.1f} s"),
    ]  # fmt: skip
    shown = [form.format(value) for value, form in figures if value is not None]
    shown += [f"{row['width']} × {row['height']}"] if row["width"] else []
    shown += [f"{row['attempts']} attempts"] if (row["attempts"] or 1) > 1 else []
    scene = scene_path(runs, row["name"]).name
    links = [("all maps", f"{scene}/overview.png"), ("scene", f"{scene}/")]
    if row["picture_hash"]:
        links.insert(0, ("edited photo", picture_path(runs, row["name"]).name))
    try:
        thumbnail = base64.b64encode(thumbnail_path(runs, row["name"]).read_bytes()).decode()
    except OSError:
        thumbnail = ""
    return {"row": row, "figures": " · ".join(shown), "links": links, "thumbnail": thumbnail}
