"""The benchmark of clicks: every click has its rows, and they say how much of the object was found."""

import numpy as np
import pytest


@pytest.mark.slow
def test_both_maps_are_scored(measured):
    rows = measured("select", scenes=1, size=96, seed=3).rows
    assert {row["method"] for row in rows} == {
        f"{how}, {what}{maps} maps"
        for how in ("network", "grabcut")
        for what in ("", "exact box, ", "loose box, ")
        for maps in ("bundled", "true")
    } and len(rows) >= 4
    assert all(0 <= row["iou"] <= 1 and row["good"] == (row["iou"] > 0.8) for row in rows)
    boxed = [row["iou"] for row in rows if row["method"] == "network, exact box, true maps"]
    assert np.mean(boxed) > 0.7
