"""`bench ablation` on one tiny photo."""

import json

import pytest

from materialist.fit.settings import PAPER
from materialist_lab import bench
from materialist_lab.bench import ablation

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rows(mitsuba, tmp_path_factory):
    patch = pytest.MonkeyPatch()
    patch.setattr(ablation, "PAPER", PAPER.at_most(60))
    patch.setattr(ablation.AblationBench, "deltas", (0.0, 50.0))
    patch.setattr(ablation.AblationBench, "steps", (2, 30))
    patch.setattr(ablation.AblationBench, "inits", 2)
    patch.setattr(ablation.AblationBench, "short", 20)
    out = tmp_path_factory.mktemp("ablation") / "out"
    bench.run(
        "ablation",
        output=out,
        scenes=1,
        size=24,
        spp=4,
        predictor="truth",
        longest=20,
        device="cpu",
    )
    patch.undo()
    assert "| 30 steps | 1 |" in (out / "report.md").read_text()
    return {row["method"]: row for row in json.loads((out / "report.json").read_text())["rows"]}


def test_every_table_has_its_rows(rows):
    names = {
        "delta 0, ARM",
        "delta 50, RM&A",
        "2 steps",
        "init 1",
        "U-Net, 20 steps",
        "direct w/o R, M",
        "fov x 0.8",
    }
    assert names <= set(rows) and all("psnr" in row for row in rows.values())


def test_what_matters_does_and_first_weights_hardly(rows):
    loss = {name: row.get("loss") for name, row in rows.items()}
    assert rows["30 steps"]["steps"] == 30 and loss["30 steps"] < loss["2 steps"]
    assert loss["delta 0, ARM"] < loss["delta 50, ARM"]
    assert (
        loss["init 0"] == pytest.approx(loss["init 1"], rel=0.2)
        and loss["init 0"] != loss["init 1"]
    )
    assert (
        rows["fov x 1"]["psnr"] > max(20, rows["fov x 1.2"]["psnr"] - 0.5)
        and "relit_psnr" in rows["fov x 0.8"]
    )


def test_real_photos_need_no_truth(measured, monkeypatch):
    monkeypatch.setattr(ablation, "PAPER", PAPER.at_most(20))
    monkeypatch.setattr(ablation.AblationBench, "short", 3)
    monkeypatch.setattr(ablation.AblationBench, "deltas", (3.0,))
    rows = measured(
        "ablation", photos=True, scenes=1, size=24, spp=4, tables="delta,fov", device="cpu"
    ).rows
    assert [row["method"] for row in rows] == [
        "delta 3, ARM",
        "delta 3, RM&A",
        "fov x 0.8",
        "fov x 1",
        "fov x 1.2",
    ]
    assert all(
        row["psnr"] > 5 and "relit_psnr" not in row and row["sample"].startswith("example:")
        for row in rows
    )


def test_a_small_weight_of_the_prior_trades_the_albedo_for_the_rerendering(measured):
    rows = measured(
        "ablation", scenes=1, size=32, spp=16, tables="weight", predictor="truth", device="cpu"
    ).rows
    psnr = [row["psnr"] for row in rows]
    albedo = [row["albedo_psnr"] for row in rows]
    assert [row["method"] for row in rows][:2] == ["albedo of the prior", "albedo's weight 0.01"]
    # The prior is the truth here: whatever the photo asks for leads away from it.
    assert psnr[1] > psnr[-1] + 1 and albedo[1] + 1 < albedo[-1] < albedo[0]
