"""Things that were hidden in part: outlines go on as they are seen to, and only behind what hid them."""

import numpy as np
import pytest

from materialist.edits.remove.amodal import going_on

ROWS, COLUMNS = np.mgrid[:120, :160]


def disc(row, column, radius):
    return np.hypot(ROWS - row, COLUMNS - column) < radius


def scene(thing, hole, near=1.0):
    """Inverse depth 0.5 behind all, 1 of the thing; what hides it is at `near`."""
    seen = thing & ~hole
    return seen, hole, np.where(seen, 1.0, 0.5), np.where(hole, near, 0.0)


@pytest.mark.parametrize("radius", [25, 38])
def test_a_disc_is_round_behind_what_hides_a_third_of_it(radius):
    thing, hole = disc(60, 60, radius), np.abs(COLUMNS - 100) < 40 + 25 - radius
    ((own, hidden),) = going_on(*scene(thing, hole, 2.0))
    assert not (hidden & ~hole).any() and (own & thing).sum() > 0.95 * (thing & ~hole).sum()
    truth = thing & hole
    assert truth.sum() > 100
    assert (hidden & truth).sum() > 0.75 * (hidden | truth).sum()


def test_a_cone_goes_on_along_its_straight_sides():
    """As a pawn: the side goes on straight to where the base goes on straight."""
    thing = (ROWS > 20) & (ROWS < 100) & (np.abs(COLUMNS - 60) < 8 + (ROWS - 20) * 0.35)
    hole = (COLUMNS - 60 > 16 - (ROWS - 100) * 0.1) & (COLUMNS < 130)
    truth = thing & hole
    ((_, hidden),) = going_on(*scene(thing, hole, 2.0))
    assert (hidden & truth).sum() > 0.5 * truth.sum(), "corners are rounded"
    assert (hidden & ~truth).sum() < 0.05 * truth.sum()


def test_what_stands_before_the_hole_ends_there():
    thing, hole = disc(60, 60, 25), np.abs(COLUMNS - 100) < 40
    assert going_on(*scene(thing, hole, 0.7)) == []


def test_the_background_is_no_thing():
    everywhere = np.ones((120, 160), bool)
    assert going_on(*scene(everywhere, disc(60, 80, 20), 2.0)) == []
    seen, hole, inverse, front = scene(~disc(60, 80, 40), disc(60, 80, 20), 2.0)
    assert going_on(seen, hole, inverse, front) == [], "and what does not reach the hole is not hidden"


def test_the_nearest_comes_first_and_steps_of_depth_part_things():
    """Two discs that touch in the picture: one mask, two depths."""
    near, far = disc(40, 70, 22), disc(82, 70, 22)
    hole = np.abs(COLUMNS - 110) < 28
    inverse = np.where(near, 1.0, np.where(far, 0.8, 0.5))
    found = going_on((near | far) & ~hole, hole, inverse, np.where(hole, 2.0, 0))
    assert [round(float(np.median(inverse[own])), 1) for own, _ in found] == [1.0, 0.8]


def test_a_selection_gives_the_outline_unless_it_is_of_something_else():
    thing, hole = disc(60, 60, 25), np.abs(COLUMNS - 100) < 40
    seen, _, inverse, front = scene(thing, hole, 2.0)
    blurred = disc(60, 60, 29) & ~hole
    asked = []

    def select(place):
        asked.append(place)
        return thing

    ((own, _),) = going_on(blurred, hole, np.where(blurred, 1.0, inverse), front, select)
    np.testing.assert_array_equal(own, seen)
    assert len(asked) == 1 and thing[asked[0][1], asked[0][0]]
    other = disc(20, 20, 10)
    assert going_on(blurred, hole, np.where(blurred, 1.0, inverse), front, lambda _: other) == []
