"""Masks of known shapes, and what cannot be selected."""

import numpy as np
import pytest
from PIL import Image
from table_top import overlap, table_top

from materialist.edits.select.select import select
from materialist.errors import InputError, MaterialistError


@pytest.fixture(scope="module")
def table():
    return table_top()


@pytest.mark.parametrize("click", [(50, 50), (75, 70), (45, 75)])
def test_one_click_finds_the_whole_object(table, click):
    scene, first, _ = table
    assert overlap(select(scene, click=click), first) > 0.9


def test_several_clicks_and_the_other_object(table):
    scene, first, second = table
    assert overlap(select(scene, click=(130, 85)), second) > 0.85
    assert overlap(select(scene, click=[(50, 50), (60, 80)]), first) > 0.9


def test_given_masks_are_taken_as_they_are(table, tmp_path):
    scene, first, _ = table
    np.testing.assert_array_equal(select(scene, mask=first), first)
    Image.fromarray((first * 255).astype(np.uint8)).save(tmp_path / "m.png")
    np.testing.assert_array_equal(select(scene, mask=tmp_path / "m.png"), first)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "exactly one"),
        ({"click": (5, 50), "box": (0, 0, 9, 9)}, "exactly one"),
        ({"click": (5, 1)}, "sky"),
        ({"click": (500, 50)}, "160 x 120"),
        ({"click": (-1, 50)}, "outside"),
        ({"click": ("a", 2)}, "must be 2 numbers"),
        ({"click": []}, "empty"),
        ({"box": (10, 10, 11, 50)}, "3 x 3"),
        ({"box": (0, 0, 160, 120)}, "whole photo"),
        ({"box": (1, 2, 3)}, "must be 4 numbers"),
        ({"mask": np.zeros((120, 160), bool)}, "empty"),
        ({"mask": np.ones((12, 16), bool)}, "(12, 16)"),
        ({"mask": "nothing.png"}, "nothing.png"),
        ({"click": (50, 50), "method": "magic"}, "magic"),
    ],
)
def test_what_cannot_be_selected(table, options, words):
    with pytest.raises(InputError) as error:
        select(table[0], **options)
    assert words in str(error.value)


def test_sam2_without_weights_says_what_to_do(table, monkeypatch, tmp_path):
    monkeypatch.setenv("MATERIALIST_MODELS", str(tmp_path))
    with pytest.raises(MaterialistError, match="leave --with sam2 out"):
        select(table[0], click=(50, 50), method="sam2")


def around(mask, more):
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    return columns[0] - more, rows[0] - more, columns[-1] + 1 + more, rows[-1] + 1 + more


@pytest.mark.parametrize("more", [0, 6])
@pytest.mark.parametrize("which", [0, 1])
def test_boxes_need_not_be_exact(table, which, more):
    scene, *things = table
    assert overlap(select(scene, box=around(things[which], more)), things[which]) > 0.85
