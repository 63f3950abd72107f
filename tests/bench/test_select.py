"""The benchmark of clicks: every click has its rows, and they say how much of the object was found."""

import json

import numpy as np

from materialist import bench


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
