"""`materialist batch`: exit codes, what is printed, the page and the tables it leaves."""

import csv
import io
import json
import re

import pytest
from made_batch import photos

import materialist as mt
from materialist.batches.outcome import COLUMNS, Outcome, write_summary


@pytest.fixture(autouse=True)
def stand_in(monkeypatch):
    """The stand-in for the inversion."""
    real = mt.batch
    monkeypatch.setattr(
        mt, "batch", lambda *a, **how: real(*a, **how | {"function": "made_batch:moody"})
    )


def test_all_done_is_0_and_a_photo_that_failed_is_2(run, tmp_path):
    source = photos(tmp_path / "in", "a", "b")
    runs = tmp_path / "runs"
    options = ("--workers", 1, "--device", "cpu", "--json")
    code, out, err = run("batch", source, "-o", runs, *options)
    said = json.loads(out.splitlines()[-1])
    assert code == 0 and said["ok"] and said["done"] == 2 and said["failed"] == 0 and not err
    code, out, err = run("batch", source, "-o", runs, *options)
    assert code == 2 and "--resume" in json.loads(out.splitlines()[-1])["message"]
    photos(source, "impossible=<b>")
    code, out, err = run("batch", source, "-o", runs, "--resume", *options[:-1])
    assert (
        code == 2
        and "2 of 3 photos done (2 of them before)" in out
        and "There is no surface" in out
    )
    assert "[3/3] impossible" in err and str(runs / "index.html") in out
    table = list(csv.DictReader((runs / "summary.csv").open()))
    assert [row["status"] for row in table] == ["done", "done", "failed"]
    assert table[0]["psnr"] == "31.25" and len(table[0]["scene_hash"]) == 64
    assert table[2]["reason"] == "There is no surface in it."
    page = (runs / "index.html").read_text()
    assert page.count("<article") == 3 and re.findall(r'src="([^"]+)"', page) == [
        "thumbs/a.jpg",
        "thumbs/b.jpg",
    ]
    assert "impossible=&lt;b&gt;" in page and "impossible=<b>" not in page
    assert (
        "default-src 'none'" in page
        and "<script" not in page
        and "http" not in page.replace("http-equiv", "")
    )
    links = set(re.findall(r'href="([^"]+)"', page))
    assert {"summary.csv", "a.scene/overview.png"} < links and all(
        (runs / link).exists() for link in {*links, "thumbs/a.jpg"}
    )
    assert page.index("impossible") < page.index("a.scene")  # what needs a look comes first


def test_a_spreadsheet_cannot_be_made_to_compute(tmp_path):
    write_summary(
        Outcome(
            tmp_path,
            ({**dict.fromkeys(COLUMNS), "id": "=1+1.png", "name": "@x", "status": "open"},),
            0,
            1.0,
        )
    )
    row = next(csv.DictReader((tmp_path / "summary.csv").open()))
    assert row["id"] == "'=1+1.png" and row["name"] == "'@x"


def test_a_reader_that_left_does_not_make_a_failed_batch_a_good_one(run, tmp_path, monkeypatch):
    def gone(*lines, **facts):
        raise BrokenPipeError

    monkeypatch.setattr("materialist.cli.batch.report_success", gone)
    monkeypatch.setattr("sys.stderr", io.StringIO())  # a command whose reader left closes it
    source = photos(tmp_path / "in", "impossible")
    assert run("batch", source, "-o", tmp_path / "runs", "--workers", 1, "--device", "cpu")[0] == 2
