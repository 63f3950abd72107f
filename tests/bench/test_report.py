"""Reports of benchmarks, and the dispatcher."""

import json

import pytest

from materialist import bench
from materialist.bench.report import Column, Report, claim, markdown, means, write
from materialist.errors import InputError, OutputError

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
    plotted=("psnr", "seconds"),
)


def test_means_are_by_method_and_leave_out_what_is_not_there():
    assert means(REPORT) == {
        "fast": {"samples": 2, "psnr": 25.0, "seconds": 2.0},
        "slow": {"samples": 2, "psnr": 26.0, "seconds": 50.0},
        "ceiling": {"samples": 1, "psnr": 44.0},
    }


def test_the_table_marks_the_best_figure_of_each_column():
    text = markdown(REPORT)
    assert "| method | samples | PSNR ↑ | s ↓ |" in text
    assert "| fast | 2 | 25.0 | **2** |" in text
    assert "| slow | 2 | **26.0** | 50 |" in text
    assert "| ceiling | 1 | 44.0 | – |" in text
    assert "What was done." in text and "size 64" in text and "None" not in text


def test_a_report_is_three_files_of_valid_content(tmp_path):
    write(REPORT, tmp_path)
    content = json.loads((tmp_path / "report.json").read_text())
    assert content["rows"][3]["psnr"] is None and content["means"]["fast"]["psnr"] == 25
    assert (tmp_path / "report.md").read_text() == markdown(REPORT)
    assert (tmp_path / "plot.png").read_bytes()[:4] == b"\x89PNG"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["plot.png", "report.json", "report.md"]


def test_a_folder_with_something_in_it_is_kept(tmp_path):
    assert claim(tmp_path / "new" / "deep").is_dir()
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="--force"):
        claim(tmp_path)
    assert claim(tmp_path, force=True) == tmp_path
    with pytest.raises(OutputError, match="cannot be made"):
        claim(tmp_path / "file" / "below")


def test_unknown_benchmarks_and_options_are_refused(tmp_path):
    with pytest.raises(InputError, match="no benchmark 'nonsense'"):
        bench.run("nonsense", output=tmp_path)
    with pytest.raises(InputError, match=r"no option 'colour'.*scenes"):
        bench.run("light", output=tmp_path / "out", colour=3)
    with pytest.raises(InputError, match=r"no method 'magic'.*paper path"):
        bench.run("light", output=tmp_path / "out", methods="default,magic")
    with pytest.raises(InputError, match="scenes is 0"):
        bench.run("light", output=tmp_path / "out", scenes=0)


@pytest.mark.parametrize(
    ("options", "words"),
    [({"scenes": "abc"}, "--scenes is 'abc'; give a whole number"), ({"scenes": 2.5}, "--scenes is 2.5"),
     ({"scenes": -1}, "--scenes is -1; give at least 1"), ({"size": 0}, "--size is 0; give at least 64"),
     ({"seed": -1}, "--seed is -1; give at least 0"),
     ({"photographic": 3}, "--photographic is 3; give true or false"),
     ({"scenes": float("nan")}, "--scenes is nan; give a whole number"), ({"size": float("inf")}, "--size is inf"),
     ({"procedural": "abc"}, "--procedural is 'abc'; give a whole number"), ({"procedural": 2.5}, "--procedural is 2"),
     ({"predictor": True}, "--predictor is True; give a value"), ({"predictor": " ,"}, "--predictor is empty")],
)  # fmt: skip
def test_options_of_another_kind_are_refused(tmp_path, options, words):
    name = "materials" if {"photographic", "procedural", "predictor"} & set(options) else "select"
    with pytest.raises(InputError, match=words):
        bench.run(name, output=tmp_path / "report", **options)
    assert not list((tmp_path / "report").glob("*"))


def test_options_are_brought_to_the_kind_that_is_taken():
    """A whole number may be written with a point, and a name may read as a number."""
    checked = bench._checked
    assert isinstance(checked("size", 64.0, "int"), int) and checked("procedural", None, "int | None") is None
    assert checked("meshes", 2024, "str") == "2024" and checked("iors", 1.5, "str | float") == 1.5
    assert isinstance(checked("goal", 1, "float"), int | float)


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [("light", {"methods": 5}, "no method '5'"), ("glass", {"iors": "abc"}, "--iors is 'abc'"),
     ("studio", {"photo": "/nope.jpg"}, "no photo at /nope.jpg"), ("thickness", {"data": "."}, "no folder 'meshes'"),
     ("select", {"data": "."}, "meshes")],
)  # fmt: skip
def test_values_that_cannot_be_are_told_at_once(tmp_path, monkeypatch, name, options, words):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=words):
        bench.run(name, output=tmp_path / "report", **options)
