"""Objects in boxes: drawn around them, too tight, too loose, and on nothing at all."""

import numpy as np
import pytest
from table_top import overlap, table_top

from materialist.edits.select import boxes
from materialist.edits.select.boxes import grown, in_box, overlap_of_boxes
from materialist.edits.select.select import select
from materialist.errors import InputError


@pytest.fixture(scope="module")
def table():
    return table_top()


def around(mask, more):
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return columns[0] - more, rows[0] - more, columns[-1] + 1 + more, rows[-1] + 1 + more


@pytest.mark.parametrize("more", [-2, 0, 8])
@pytest.mark.parametrize("which", [0, 1])
def test_boxes_need_not_be_exact(table, which, more):
    scene, *things = table
    assert overlap(select(scene, box=around(things[which], more)), things[which]) > 0.85


def test_a_box_that_leaves_nothing_is_tried_larger(table, monkeypatch):
    scene, first, _ = table
    box, tried = around(first, -3), []

    def grabcut(scene, label, rounds):
        tried.append(int((label > 0).sum()))
        return first if len(tried) == 3 else np.zeros_like(first)

    monkeypatch.setattr(boxes, "grabcut", grabcut)
    np.testing.assert_array_equal(in_box(scene, box, network=False), boxes.tidy(first, None))
    assert tried == sorted(tried) and len(set(tried)) == len(tried) >= 3


@pytest.mark.parametrize("sure", [False, True])
def test_the_network_is_believed_where_it_is_sure(table, monkeypatch, sure):
    """It is told a half of the object; a loose box alone holds the table, too."""
    scene, first, _ = table
    half = first & (np.indices(first.shape)[1] < 50)
    share = np.where(half, 0.95 if sure else 0.55, 0.02 if sure else 0.4).astype(np.float32)
    monkeypatch.setattr(boxes, "likely", lambda scene, points: share * (first | half))
    seen = []
    monkeypatch.setattr(boxes, "grabcut", lambda scene, label, rounds: seen.append(label) or label == boxes.PROBABLE)
    found = in_box(scene, around(first, 6))
    assert (overlap(found, half) > 0.9) == sure and len(seen) == (2 if sure else 1)


def test_what_ends_outside_of_the_box_is_not_meant(table, monkeypatch):
    scene, first, _ = table
    everywhere = np.ones(first.shape, np.float32)
    monkeypatch.setattr(boxes, "likely", lambda scene, points: everywhere)
    np.testing.assert_array_equal(in_box(scene, around(first, 6)), in_box(scene, around(first, 6), network=False))


def test_overlap_of_boxes():
    mask = np.zeros((10, 20), bool)
    assert overlap_of_boxes(mask, (0, 0, 4, 4)) == 0
    mask[2:6, 4:8] = True
    assert overlap_of_boxes(mask, (4, 2, 8, 6)) == 1
    assert overlap_of_boxes(mask, (6, 2, 10, 6)) == pytest.approx(8 / 24)
    assert overlap_of_boxes(mask, (12, 2, 16, 6)) == 0
    assert grown((4, 2, 8, 6), 0.5, mask.shape) == (2, 0, 10, 8)
    assert grown((0, 0, 20, 10), 0.5, mask.shape) == (0, 0, 20, 10)


def test_a_box_on_nothing_says_what_to_do(table, monkeypatch):
    scene, *_ = table
    monkeypatch.setattr(boxes, "grabcut", lambda scene, label, rounds: np.zeros(label.shape, bool))
    with pytest.raises(InputError, match="draw the box a little larger"):
        select(scene, box=(50, 50, 60, 60), method="grabcut")
