"""`materialist batch`: exit codes, what is printed, the page and the tables it leaves."""

import csv
import functools
import json
import re

import pytest
from made_batch import photos

import materialist.batches.run as batch_run
from materialist.batches.outcome import Outcome, Row
from materialist.batches.page import PER_PAGE, write_pages
from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code


@pytest.fixture
def run(capsys, monkeypatch):
    """Run a command line with the stand-in for the inversion; returns (exit code, stdout, stderr)."""
    monkeypatch.setattr(batch_run, "batch", functools.partial(batch_run.batch, function="made_batch:moody"))

    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


def test_all_done_is_0_and_a_photo_that_failed_is_2(run, tmp_path):
    source, runs = photos(tmp_path / "in", "a", "b"), tmp_path / "runs"
    options = ("--workers", 1, "--device", "cpu", "--json")
    code, out, err = run("batch", source, "-o", runs, *options)
    said = json.loads(out.splitlines()[-1])
    assert code == 0 and said["ok"] and said["done"] == 2 and said["failed"] == 0 and not err
    code, out, err = run("batch", source, "-o", runs, *options)
    assert code == 2 and "--resume" in json.loads(out.splitlines()[-1])["message"]
    photos(source, "impossible=<b>")
    code, out, err = run("batch", source, "-o", runs, "--resume", *options[:-1])
    assert code == 2 and "2 of 3 photos done (2 of them before)" in out and "There is no surface" in out
    assert "[3/3] impossible" in err and str(runs / "index.html") in out
    table = list(csv.DictReader((runs / "summary.csv").open()))
    assert [row["status"] for row in table] == ["done", "done", "failed"]
    assert table[0]["psnr"] == "31.25" and len(table[0]["scene_hash"]) == 64
    assert table[2]["reason"] == "There is no surface in it."
    page = (runs / "index.html").read_text()
    assert page.count("<article") == 3 and page.count("data:image/jpeg;base64,") == 2
    assert "impossible=&lt;b&gt;" in page and "impossible=<b>" not in page
    assert "default-src 'none'" in page and "<script" not in page and "http" not in page.replace("http-equiv", "")
    links = set(re.findall(r'href="([^"]+)"', page))
    assert {"summary.csv", "a.scene/overview.png"} < links and all((runs / link).exists() for link in links)


def test_many_photos_take_several_pages(tmp_path):
    rows = tuple(Row({"id": f"{k}.png", "name": str(k), "status": "done", "seconds": 1.0}) for k in range(PER_PAGE + 1))
    failed = Row({"id": "x.png", "name": "x", "status": "failed", "reason": "no"})
    write_pages(Outcome(tmp_path, (*rows, failed), 0, 1.0))
    first, second = ((tmp_path / name).read_text() for name in ("index.html", "index-2.html"))
    assert first.count("<article") == PER_PAGE and second.count("<article") == 2
    assert first.index("x.png") < first.index("0.png")  # what needs a look comes first
    assert 'href="index-2.html"' in first and 'href="index.html"' in second


def test_a_spreadsheet_cannot_be_made_to_compute(tmp_path):
    from materialist.batches.outcome import write_summary

    write_summary(Outcome(tmp_path, (Row({"id": "=1+1.png", "name": "@x", "status": "open"}),), 0, 1.0))
    row = next(csv.DictReader((tmp_path / "summary.csv").open()))
    assert row["id"] == "'=1+1.png" and row["name"] == "'@x"
