"""The benchmark of clicks: every click has its rows, and they say how much of the object was found."""

import numpy as np
import pytest

from materialist.errors import InputError
from materialist_lab.bench import select as bench
from materialist_lab.bench.select import clickable, drawn, outlines


@pytest.mark.slow
def test_both_maps_are_scored(measured):
    rows = measured("select", scenes=1, size=96, seed=3).rows
    names = [
        *("network", "network, exact box", "network, loose box", "one key"),
        *("grabcut", "grabcut, exact box", "grabcut, loose box"),
    ]
    expected = {f"{name}, {maps} maps" for name in names for maps in ("bundled", "true")}
    assert {row["method"] for row in rows} == expected and len(rows) >= 4
    assert all(0 <= row["iou"] <= 1 and row["good"] == (row["iou"] > 0.8) for row in rows)
    boxed = [row["iou"] for row in rows if row["method"] == "network, exact box, true maps"]
    assert np.mean(boxed) > 0.7
    for maps in ("bundled", "true"):
        once, keyed = (
            [row["iou"] for row in rows if row["method"] == f"{name}, {maps} maps"]
            for name in ("network", "one key")
        )
        assert len(once) == len(keyed) and (np.array(keyed) >= np.array(once)).all()


def test_outlined_objects_are_drawn_where_they_are():
    whole = {
        "outline": [[100, 50], [300, 50], [300, 200], [100, 200]],
        "holes": [[[120, 60], [140, 60], [130, 90]]],
    }
    part = {"outline": [[200, 100], [250, 100], [250, 150], [200, 150]], "part": True}
    (mask, place), (inner, _) = clickable([whole, part], (128, 256))
    assert abs(int(mask.sum()) - (100 * 75 - 75)) < 20 and int(inner.sum()) == 25 * 25
    rows, columns = np.nonzero(inner)
    assert (rows.min(), columns.min()) == (50, 100) and (mask & ~place).sum() == inner.sum()


def test_all_outlines_can_be_drawn():
    for name, objects in outlines().items():
        for thing in objects:
            corners = np.concatenate([thing["outline"], *thing.get("holes", [])])
            assert corners.min() >= -1 and corners.max() <= 513, (name, thing["name"])
            assert drawn(thing, (512, 512)).sum() >= 400, (name, thing["name"])


def test_all_materials_can_be_drawn_and_hold_their_click():
    things = [thing for parts in outlines("materials").values() for thing in parts]
    assert len(things) == 20
    for thing in things:
        mask = drawn(thing, (512, 512))
        x, y = thing["click"]
        assert mask[int(y), int(x)] and mask.sum() >= 400, thing["name"]


def test_a_surplus_is_clicked_where_somebody_would(monkeypatch):
    mask = np.zeros((40, 60), bool)
    mask[5:35, 5:30] = True
    wide = mask.copy()
    wide[5:35, 30:45] = True
    asked = []

    def select(scene, click, same_material, exclude=()):
        asked.append((same_material, list(exclude)))
        if len(exclude) > 1:
            raise InputError("It cannot be told from the rest.")
        thin = mask | (np.indices(mask.shape)[1] == 30)
        return thin if same_material else mask | (wide & (np.arange(60) < 38)) if exclude else wide

    monkeypatch.setattr(bench, "select", select)
    rows = list(bench._narrowed(None, mask, (10, 10)))
    assert [name for name, _ in rows][:3] == [
        "one click",
        "one click, one excluded",
        "one click, two excluded",
    ]
    assert 32 <= asked[1][1][0][0] <= 42
    assert (rows[2][1] == rows[1][1]).all()  # refused
    assert sum(same for same, _ in asked) == 1  # a border is not clicked
