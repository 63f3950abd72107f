"""Reports of benchmarks, and the dispatcher."""

import json
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from materialist.errors import InputError, OutputError
from materialist_lab import bench
from materialist_lab.bench.glass import GlassBench
from materialist_lab.bench.report import Column, Report, claim, markdown, write
from materialist_lab.bench.select import SelectBench

REPORT = Report(
    title="Trial",
    note="What was done.",
    settings={"size": 64, "data": None},
    columns=(Column("psnr", "PSNR", "higher", 1), Column("seconds", "s", "lower", 0)),
    rows=[
        {"method": "fast", "sample": "a", "psnr": 20.0, "seconds": 1},
        {"method": "fast", "sample": "b", "psnr": 30.0, "seconds": 3},
        {"method": "slow", "sample": "a", "psnr": 26.0, "seconds": 50},
        {"method": "slow", "sample": "b", "psnr": float("inf"), "seconds": 50},
        {"method": "ceiling", "sample": "a", "psnr": 44.0},
    ],
)


def test_the_table_marks_the_best_figure_of_each_column():
    text = markdown(REPORT)
    assert "| method | samples | PSNR ↑ | s ↓ |" in text
    assert "| fast | 2 | 25.0 | **2** |" in text
    assert "| slow | 2 | **26.0** | 50 |" in text
    assert "| ceiling | 1 | 44.0 | – |" in text
    assert "What was done." in text and "size 64" in text and "None" not in text


def test_methods_compete_within_their_part():
    rows = [
        {"method": m, "sample": "a", "psnr": v}
        for m, v in (("hue: a", 1), ("hue: b", 2), ("cup: a", 8), ("cup: b", 9))
    ]
    text = markdown(
        replace(REPORT, rows=[*rows, {"method": "cup: ceiling", "sample": "a", "psnr": 99}])
    )
    assert (
        "| hue: b | 1 | **2.0** |" in text
        and "| cup: b | 1 | **9.0** |" in text
        and text.count("**") == 4
    )


def test_a_report_is_two_files_of_valid_content(tmp_path):
    write(REPORT, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text())
    assert content["rows"][3]["psnr"] is None
    assert content["means"] == {
        "fast": {"samples": 2, "psnr": 25.0, "seconds": 2.0},
        "slow": {"samples": 2, "psnr": 26.0, "seconds": 50.0},
        "ceiling": {"samples": 1, "psnr": 44.0},
    }
    assert (tmp_path / "report.md").read_text() == markdown(REPORT)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["report.json", "report.md"]


def test_larger_pictures_are_files_of_their_own(tmp_path):
    write(replace(REPORT, pictures={"a_room": np.zeros((4, 6, 3), np.uint8)}), tmp_path)
    assert Image.open(tmp_path / "pictures" / "a_room.png").size == (6, 4)


def test_a_folder_with_something_in_it_is_kept(tmp_path):
    with pytest.raises(OutputError, match="no folder"):
        claim(tmp_path / "new" / "deep")
    assert claim(tmp_path / "new").is_dir() and claim(tmp_path / "new" / "deep").is_dir()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        claim(tmp_path)
    assert claim(tmp_path, force=True) == tmp_path
    with pytest.raises(OutputError, match="cannot be written"):
        claim(tmp_path / "file" / "below")


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("nonsense", {}, "no benchmark 'nonsense'"),
        ("light", {"colour": 3}, "no option 'colour'.*scenes"),
        (
            "light",
            {"methods": "default,magic"},
            "'magic' is unknown; choose from default.*paper path",
        ),
        ("light", {"scenes": 0}, "scenes is 0"),
        ("select", {"scenes": "abc"}, "scenes must be a number"),
        ("select", {"seed": -1}, "seed is -1"),
        ("select", {"data": "."}, "meshes"),
        ("materials", {"photographic": 3}, "photographic must be true or false"),
        ("materials", {}, "nothing to score"),
        ("materials", {"data": ".", "predictor": " ,"}, "predictor is empty"),
        ("materials", {"data": ".", "predictor": "constant"}, "neither 'samples'"),
        ("ablation", {"tables": "delta,tau"}, "'tau' is unknown; choose from delta, steps"),
        ("ablation", {"photos": True, "predictor": "truth"}, "truth"),
        ("batch", {"workers": 0}, "workers is '0'"),
        ("edit", {"kinds": "repaint"}, "'repaint' is unknown"),
        ("glass", {"iors": "0.9"}, "iors is '0.9'"),
        ("glass", {"background": "sea"}, "background is 'sea'; choose one of room, envmap"),
        ("glass", {"shapes": 0}, "nothing to measure"),
        ("invert", {"sizes": "12,x"}, "with commas"),
        ("invert", {"data": "."}, "holds neither"),
        ("real", {}, "photographs with measured truth"),
        ("real", {"data": "."}, r"holds no photographs .*real_light/ with NAME/lights\.json"),
        ("real", {"data": ".", "predictor": "magic"}, "no predictor 'magic'"),
        ("plate", {"data": "."}, r"materialist_indoor1\.png"),
        ("predictor", {"runs": 0}, "runs is 0"),
        ("studio", {"photo": "/nope.jpg"}, "no photo at /nope.jpg"),
        ("studio", {"moves": 1}, "moves is 1"),
        ("studio", {"click": "middle"}, "click must be 2 numbers"),
        ("thickness", {"data": "."}, "no folder 'meshes'"),
        ("thickness", {"shapes": 0}, "shapes is 0"),
        ("whdr", {}, "needs the IIW data set"),
        ("whdr", {"data": "."}, "no picture with judgements"),
    ],
)
def test_what_cannot_be_is_told_before_anything_is_written(
    tmp_path, monkeypatch, name, options, words
):
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    with pytest.raises(InputError, match=words):
        bench.run(name, output=tmp_path / "report", **options)
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]


def test_a_run_that_cannot_begin_keeps_a_folder_that_was_there(tmp_path):
    with pytest.raises(InputError, match="nothing to measure"):
        bench.run("glass", output=tmp_path, shapes=0)
    assert tmp_path.is_dir()


def test_options_are_brought_to_the_kind_that_is_taken():
    """A whole number may be written with a point, and a name may read as a number."""
    bench = SelectBench.merged(scenes="3", size="64.0", loose="0.5", device="cpu")
    assert (bench.scenes, bench.size, bench.loose) == (3, 64, 0.5) and isinstance(bench.size, int)
    assert GlassBench.merged(iors=1.5, shapes="3") == GlassBench(iors="1.5", shapes=3)


def test_a_run_that_is_stopped_leaves_the_rows_that_were_measured(tmp_path, monkeypatch):
    def rows(self, data, report):
        yield {"method": "one", "sample": 0, "iou": 0.5}
        raise KeyboardInterrupt

    monkeypatch.setattr(SelectBench, "rows", rows)
    with pytest.raises(KeyboardInterrupt):
        bench.run("select", output=tmp_path)
    content = json.loads((tmp_path / "report.json").read_text())
    assert content["title"].startswith("`bench select`") and content["means"]["one"] == {
        "samples": 1,
        "iou": 0.5,
    }
