"""The benchmark of clicks: every click has its rows, and they say how much of the object was found."""

import json

import numpy as np

from materialist import bench
from materialist.bench.select import boxes, clicks


def test_clicks_are_in_the_middle_and_inside():
    mask = np.zeros((40, 50), bool)
    mask[10:31, 20:41] = True
    usable = np.ones_like(mask)
    middle, other = clicks(mask, usable, np.random.default_rng(0))
    assert middle == (30, 20) and mask[other[1], other[0]]
    assert 12 <= other[1] <= 28 and 22 <= other[0] <= 38
    usable[:, 30] = False
    assert len(clicks(mask, usable, np.random.default_rng(0))) == 1  # a click on the sky is none


def test_both_maps_are_scored(tmp_path, mitsuba):
    bench.run("select", output=tmp_path / "report", scenes=1, size=96, seed=3)
    report = json.loads((tmp_path / "report" / "report.json").read_text())
    rows = report["rows"]
    assert {row["method"] for row in rows} == {
        f"{how}, {what}{maps} maps"
        for how in ("network", "grabcut")
        for what in ("", "exact box, ", "loose box, ")
        for maps in ("bundled", "true")
    } and len(rows) >= 4
    assert all(0 <= row["iou"] <= 1 and row["good"] == (row["iou"] > 0.8) for row in rows)
    boxed = [row["iou"] for row in rows if row["method"] == "network, exact box, true maps"]
    assert np.mean(boxed) > 0.7


def test_boxes_are_exact_and_loose():
    mask = np.zeros((40, 50), bool)
    mask[10:30, 10:40] = True
    assert boxes(mask, 0.1) == {"exact box": (10, 10, 40, 30), "loose box": (8, 8, 42, 32)}
