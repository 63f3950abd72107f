"""Batches with a stand-in for the inversion: what is done, what is recorded, what is done again."""

import json
import os

import numpy as np
import pytest
from made_batch import photos, run
from PIL import Image

from materialist.batches.ledger import LEDGER, read_events
from materialist.batches.results import package_hash
from materialist.errors import InputError, OutputError, SetupError

RECIPE = "- edit:\n    mask: masks/{name}.png\n    hue: 90\n"


def reasons(outcome):
    return {row["name"]: row["reason"] for row in outcome.rows if row["status"] == "failed"}


def test_every_photo_ends_as_done_or_with_a_reason(tmp_path):
    source = photos(
        tmp_path / "in", "a", "sub/b", "sub/a.jpg", "bug", "impossible", "deadly", "deadly-once"
    )
    (source / "cut.png").write_bytes((source / "a.png").read_bytes()[:60])
    seen = []
    outcome = run(source, tmp_path / "runs", progress=seen.append)
    why = reasons(outcome)
    done = {row["name"] for row in outcome.rows if row["status"] == "done"}
    assert done == {"a.png", "b", "sub_a.jpg", "deadly-once"}
    assert why["bug"] == "three is not four" and why["impossible"] == "There is no surface in it."
    assert "SIGKILL" in why["deadly"] and "begun 3 times" in why["deadly"]
    assert "damaged or truncated" in why["cut"] or "not an image" in why["cut"]
    attempts = {row["name"]: row["attempts"] for row in outcome.rows}
    assert attempts["deadly-once"] == 2 and attempts["deadly"] == 3 and attempts["impossible"] == 1
    assert outcome.exit_code == 1  # a bug of ours is among them
    last = seen[-1]
    assert (last.total, last.done, last.failed) == (8, 4, 4) and not last.running
    traces = [e["trace"] for e in read_events(tmp_path / "runs" / LEDGER) if e.get("trace")]
    assert len(traces) == 1 and "RuntimeError" in traces[0]


@pytest.mark.slow
def test_results_do_not_depend_on_the_number_of_workers_or_what_ran_before(tmp_path):
    source = photos(tmp_path / "in", "a", "b", "c")
    one = run(source, tmp_path / "one", workers=1)
    three = run(source, tmp_path / "three", workers=3)
    run(source / "c.png", tmp_path / "alone")
    assert one.hash == three.hash and one.exit_code == 0
    assert package_hash(tmp_path / "alone/c.scene") == package_hash(tmp_path / "one/c.scene")
    assert json.loads((tmp_path / "one/summary.json").read_text())["hash"] == one.hash


def test_finished_photos_are_kept_and_all_others_redone(tmp_path):
    source = photos(tmp_path / "in", "a", "b", "c", "d")
    first = run(source, tmp_path / "runs", workers=1)
    written = (tmp_path / "runs/a.scene/scene.json").stat().st_mtime_ns
    (tmp_path / "runs/b.scene/maps/albedo.exr").unlink()
    Image.fromarray(np.random.default_rng(9).integers(0, 256, (16, 24, 3)).astype(np.uint8)).save(
        source / "c.png"
    )
    (source / "d.png").unlink()
    photos(source, "x", "new")  # the first is only there to make the second another picture
    (source / "x.png").unlink()
    with pytest.raises(InputError, match="resume=True"):
        run(source, tmp_path / "runs", workers=1)
    again = run(source, tmp_path / "runs", resume=True, workers=1)
    assert again.kept == 1 and again.exit_code == 0 and again.count("done") == 4
    assert (tmp_path / "runs/a.scene/scene.json").stat().st_mtime_ns == written
    assert (
        again.hash != first.hash and again.hash == run(source, tmp_path / "fresh", workers=1).hash
    )


@pytest.mark.slow
def test_what_lies_there_of_somebody_else_is_not_replaced(tmp_path):
    source = photos(tmp_path / "in", "b")
    runs = tmp_path / "runs"
    run(source, runs)
    photos(source, "a")
    (runs / "a.scene").mkdir()
    (runs / "a.scene" / "mine.txt").write_text("mine")
    (runs / "b.png").write_bytes(b"mine")
    for _ in range(2):
        outcome = run(source, runs, resume=True, apply=masks(tmp_path, "a", "b"), spp=2)
        assert reasons(outcome).keys() == {"a", "b"}
        assert all(
            "exists and is not of this batch" in reason for reason in reasons(outcome).values()
        )
        assert (runs / "a.scene" / "mine.txt").read_text() == (runs / "b.png").read_text() == "mine"
    (runs / "b.png").unlink()
    outcome = run(source, runs, resume=True, apply=masks(tmp_path, "a", "b"), spp=2)
    assert outcome.count("done") == 1 and outcome.rows[1]["invert_seconds"], "the scene is kept"


def test_what_every_photo_lacks_stops_the_batch_at_once(tmp_path):
    source = photos(tmp_path / "in", *(f"lacking{k}" for k in range(30)))
    with pytest.raises(SetupError, match="No LLVM found"):
        run(source, tmp_path / "runs")
    summary = json.loads((tmp_path / "runs/summary.json").read_text())
    assert summary["open"] == 30 and summary["failed"] == 0


def test_a_full_disk_stops_the_batch_at_once(tmp_path):
    source = photos(tmp_path / "in", *(f"full{k}" for k in range(30)))
    with pytest.raises(OutputError, match="make room"):
        run(source, tmp_path / "runs")
    summary = json.loads((tmp_path / "runs/summary.json").read_text())
    assert summary["open"] + summary["failed"] == 30
    assert summary["failed"] <= 1


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"size": 4}, "working size"),
        ({"fov": "wide"}, "field of view"),
        ({"seed": -1}, "seed is -1"),
        ({"predictor": "oracle"}, "no predictor 'oracle'"),
        ({"workers": 0}, "workers is 0; it must lie"),
        ({"quality": 80}, "png has none"),
        ({"apply": "none.yaml"}, "cannot be read"),
        ({"settings": object()}, "texts and numbers"),
    ],
)
def test_options_that_fit_no_photo_are_refused_before_anything_is_written(tmp_path, options, said):
    source = photos(tmp_path / "in", "a")
    with pytest.raises(InputError, match=said):
        run(source, tmp_path / "runs", **options)
    assert not (tmp_path / "runs").exists()


def masks(folder, *names):
    (folder / "masks").mkdir(exist_ok=True)
    for name in names:
        Image.fromarray(np.pad(np.full((8, 8), 255, np.uint8), ((4, 4), (8, 8)))).save(
            folder / f"masks/{name}.png"
        )
    (folder / "edits.yaml").write_text(RECIPE)
    return folder / "edits.yaml"


@pytest.mark.slow
def test_edits_are_applied_with_masks_by_name_and_redone_without_the_inversion(tmp_path):
    pytest.importorskip("mitsuba")
    source = photos(tmp_path / "in", "a", "b")
    recipe = masks(tmp_path, "a")
    runs = tmp_path / "runs"
    options = {"apply": recipe, "spp": 2, "workers": 1}
    first = run(source, runs, **options)
    assert "masks/b.png" in reasons(first)["b"] and reasons(first)["b"].startswith(
        "The scene is there"
    )
    assert (runs / "b.scene").is_dir() and not (runs / "b.png").exists() and first.exit_code == 2
    assert Image.open(runs / "a.png").size == Image.open(source / "a.png").size
    written = (runs / "b.scene/scene.json").stat().st_mtime_ns
    masks(tmp_path, "b")
    again = run(source, runs, resume=True, **options)
    assert again.exit_code == 0 and again.kept == 1 and (runs / "b.png").exists()
    assert (runs / "b.scene/scene.json").stat().st_mtime_ns == written
    assert run(source, runs, resume=True, **options).kept == 2
    recipe.write_text(RECIPE.replace("90", "200"))
    other = run(source, runs, resume=True, **options)
    assert (
        other.kept == 0
        and other.exit_code == 0
        and other.rows[0]["edits"] != again.rows[0]["edits"]
    )
    small = run(source, runs, resume=True, **options, format="jpg", quality=60)
    assert small.kept == 0 and Image.open(runs / "a.jpg").format == "JPEG"
    assert run(source, runs, resume=True, **options, format="jpg", quality=60).kept == 2
    assert run(source, runs, resume=True, **options, format="jpg", quality=90).kept == 0
    assert (
        'href="a.jpg"' in (runs / "index.html").read_text() and small.rows[0]["picture"] == "a.jpg"
    )
    assert (runs / "b.scene/scene.json").stat().st_mtime_ns == written


def test_a_file_name_that_is_no_utf8_is_a_photo_like_any_other(tmp_path):
    source = photos(tmp_path / "in", "a")
    try:
        os.rename(source / "a.png", os.fsencode(source) + b"/caf\xe9.png")
    except OSError:
        pytest.skip("this file system takes only UTF-8")
    outcome = run(source, tmp_path / "runs", workers=1)
    assert outcome.exit_code == 0, reasons(outcome)
    assert (
        outcome.rows[0]["id"] == "caf\\udce9.png"
        and "caf" in (tmp_path / "runs/index.html").read_text()
    )
