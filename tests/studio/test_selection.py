"""Clicks, boxes and strokes."""

from functools import partial

import numpy as np
import pytest
from scipy.ndimage import binary_erosion
from studio_scenes import block, room

from materialist.edits.select.objects import overlap
from materialist.edits.select.select import select
from materialist.errors import InputError
from materialist.studio.live.process import PreviewLost
from materialist.studio.selection import Selection

CHOOSE = partial(select, room())


def test_click_add_and_remove():
    scene = room()
    one = Selection().click(scene, 25, 24, "new", CHOOSE)
    assert one.mask is not None and overlap(one.mask, block()) > 0.9
    both = one.click(scene, 50, 40, "add", CHOOSE).mask
    assert both is not None and both[40, 50] and both[24, 25]
    two = one.brush(scene, [[44, 40], [56, 40]], 4, "add", CHOOSE)
    again = two.click(scene, 25, 24, "add", CHOOSE).mask
    assert again is not None and (again >= two.mask).all(), "adding takes nothing away"
    assert two.click(scene, 25, 24, "new", CHOOSE).mask[24, 25] == False  # noqa: E712 - on what is selected: taken away
    assert one.click(scene, 25, 24, "new", CHOOSE).mask is None
    assert one.click(scene, 50, 40, "remove", CHOOSE) is one


def test_a_piece_of_one_colour_is_taken_out_of_a_selection():
    scene = room()
    whole = Selection((scene.depth > 0,))
    left = whole.click(scene, 25, 24, "remove", CHOOSE).mask
    # The network's outline may miss a pixel of a corner.
    assert left is not None and not left[binary_erosion(block())].any()
    assert left[block()].mean() < 0.02
    assert left[(scene.depth > 0) & ~block()].mean() > 0.95
    assert Selection((block(),)).click(scene, 25, 24, "remove", CHOOSE).mask is None


def test_box_and_brush():
    scene = room()
    boxed = Selection().box(scene, [12, 12, 40, 36], "new", CHOOSE)
    assert boxed.mask is not None and overlap(boxed.mask, block()) > 0.8
    rubbed = boxed.box(scene, [0, 0, 64, 24], "remove", CHOOSE)
    assert rubbed.mask is not None and not rubbed.mask[:24].any() and rubbed.mask[26].any()
    painted = Selection().brush(scene, [[10, 40], [30, 40]], 3, "add", CHOOSE)
    assert painted.mask is not None and painted.mask[40, 10:31].all() and not painted.mask[34].any()
    assert painted.brush(scene, [[0, 40], [63, 40]], 8, "remove", CHOOSE).mask is None


def test_a_click_takes_less_or_more():
    """Regions of one click by size; what was selected before it stays."""
    scene = room()
    sizes = {"auto": 12, "small": 6, "medium": 12, "large": 20}

    def choose(click, extent="auto", sharpen=True):
        region = np.zeros((48, 64), bool)
        x, y = click
        region[y - 4 : y + 4, x : x + sizes[extent]] = True
        return region

    first = np.zeros((48, 64), bool)
    first[:5] = True
    one = Selection((first,)).click(scene, 25, 24, "add", choose)
    more = one.resized(True, choose)
    assert more.mask is not None and more.mask.sum() == first.sum() + 8 * 20
    assert more.resized(False, choose).mask.sum() == one.mask.sum()
    less = one.resized(False, choose)
    assert less.mask.sum() == first.sum() + 8 * 6
    with pytest.raises(InputError, match="Nothing larger"):
        more.resized(True, choose)
    with pytest.raises(InputError, match="Nothing smaller"):
        less.resized(False, choose)
    twice = one.click(scene, 25, 24, "add", choose)
    with pytest.raises(InputError, match="Nothing smaller"):
        twice.resized(False, choose)  # the first click keeps it
    assert twice.resized(True, choose).mask.sum() == more.mask.sum()
    for other in (one.brush(scene, [[44, 40]], 4, "add", CHOOSE), Selection((first,))):
        with pytest.raises(InputError, match="Click an object first"):
            other.resized(True, choose)


def test_only_what_has_the_material_of_the_click():
    scene = room()
    whole = block() | (np.indices((48, 64))[1] > 58)  # the block, and some wall
    one = Selection((np.eye(48, 64, dtype=bool),)).click(
        scene, 25, 24, "add", lambda click: whole.copy()
    )
    asked = []

    def narrowed(region, click):
        asked.append(click)
        return region & block()

    narrow = one.of_material(narrowed)
    assert asked == [(25, 24)]
    assert overlap(narrow.parts[-1], block()) > 0.9 and narrow.clicked == one.clicked
    assert np.array_equal(narrow.parts[0], one.parts[0])
    with pytest.raises(InputError, match="seems to be of one material"):
        narrow.of_material(narrowed)
    with pytest.raises(InputError, match="Click an object first"):
        Selection((whole,)).of_material(narrowed)


def test_alt_takes_a_thing_from_the_part_it_lies_in():
    scene = room()
    left = np.zeros((48, 64), bool)
    left[8:44, 2:40] = True
    right = np.zeros((48, 64), bool)
    right[36:44, 50:60] = True
    asked = []

    thing = np.zeros((48, 64), bool)
    thing[34:44, 2:20] = True

    def choose(click=None, mask=None, exclude=None):
        if mask is None:
            return left.copy()
        asked.append(exclude)
        if exclude != (10, 40):
            raise InputError("That is most of the selection.")
        return mask & ~thing

    two = Selection((right,)).click(scene, 25, 12, "add", choose)
    after = two.click(scene, 10, 40, "remove", choose)
    assert asked == [(10, 40)]
    assert np.array_equal(after.parts[0], right)
    assert not after.parts[1][36:44, 2:18].any() and after.parts[1][10:30, 4:38].all()
    assert after.clicked == (25, 12)  # S goes on from there
    # On the small part nothing is left of it, and the other stays; the last click is still that of the other.
    rest = two.click(scene, 55, 40, "remove", choose)
    assert len(rest.parts) == 1 and np.array_equal(rest.parts[0], left)
    # On its own click the piece of one colour goes, and the click with it.
    gone = two.click(scene, 25, 12, "remove", choose)
    assert gone.clicked is None and not gone.mask[12, 25] and gone.mask[40, 55]


def test_alt_without_a_preview_changes_nothing():
    def lost(**_):
        raise PreviewLost("The live preview has ended.")

    with pytest.raises(PreviewLost):
        Selection((block(),)).click(room(), 25, 24, "remove", lost)
