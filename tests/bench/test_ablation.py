"""`bench ablation` on one tiny photo."""

import json

import pytest

from materialist import bench
from materialist.bench import ablation


@pytest.fixture(scope="module")
def rows(mitsuba, tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(ablation.AblationBench, "deltas", (0.0, 50.0))
    patch.setattr(ablation.AblationBench, "steps", (2, 30))
    patch.setattr(ablation.AblationBench, "inits", 2)
    patch.setattr(ablation.AblationBench, "short", 20)
    out = tmp_path_factory.mktemp("ablation") / "out"
    bench.run("ablation", output=out, scenes=1, size=24, spp=4, predictor="truth", longest=20, device="cpu")
    patch.undo()
    assert (out / "plot.png").stat().st_size > 0 and "| 30 steps | 1 |" in (out / "report.md").read_text()
    return {row["method"]: row for row in json.loads((out / "report.json").read_text())["rows"]}


def test_every_table_has_its_rows(rows):
    names = list(rows)
    for part in (["delta 0, ARM", "delta 50, RM&A", "2 steps", "init 1", "U-Net, 20 steps",
                              "direct w/o R, M", "fov x 0.8"]):  # fmt: skip
        assert part in names, part
    assert all("psnr" in row for row in rows.values())


def test_more_steps_and_a_smaller_price_fit_the_photo_closer(rows):
    assert rows["30 steps"]["steps"] == 30 and rows["2 steps"]["steps"] == 2
    assert rows["30 steps"]["loss"] < rows["2 steps"]["loss"]
    assert rows["delta 0, ARM"]["loss"] < rows["delta 50, ARM"]["loss"]


def test_first_weights_hardly_matter(rows):
    assert rows["init 0"]["loss"] == pytest.approx(rows["init 1"]["loss"], rel=0.2)
    assert rows["init 0"]["loss"] != rows["init 1"]["loss"]


def test_the_true_field_of_view_is_the_reference(rows):
    assert rows["fov x 1"]["psnr"] > 20 and {"relit_psnr"} <= set(rows["fov x 0.8"])
    assert rows["fov x 1"]["psnr"] > rows["fov x 1.2"]["psnr"] - 0.5
