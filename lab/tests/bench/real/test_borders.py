"""Borders of known composites: what is measured is what is wrong."""

import numpy as np
import pytest

from materialist.types import Camera, Photo
from materialist_lab.bench.edit import stray
from materialist_lab.bench.real.borders import KnownComposite, boundary_f, colour_errors


def test_a_border_counts_within_two_pixels():
    true = np.zeros((40, 40), bool)
    true[10:30, 10:30] = True
    near = np.roll(true, 2, 1)
    far = np.roll(true, 6, (0, 1))
    assert boundary_f(true, true) == 1 and boundary_f(near, true) > 0.95
    assert boundary_f(far, true) < 0.5 and boundary_f(np.zeros_like(true), true) == 0


def test_a_mask_that_misses_the_thing_has_larger_errors():
    share = np.zeros((80, 80), np.float32)
    share[20:60, 20:60] = 1
    share[20:60, 60] = 0.5
    colour = np.full((80, 80, 3), (0.6, 0.1, 0.1), np.float32)
    light = share[..., None] * colour
    native = light + (1 - share[..., None]) * np.float32(0.4)
    linear = native.reshape(20, 4, 20, 4, 3).mean((1, 3))
    known = KnownComposite("square", Photo(linear, Camera(20, 20, 40.0), native), share, light)
    good = known.errors(known.mask)
    bad = known.errors(np.roll(known.mask, 5, 1))
    assert good["border"] > 0.99 and good["sad"] < 0.2 and good["fringe"] < 8
    assert bad["border"] < good["border"] and bad["sad"] > 5 * good["sad"]
    assert bad["fringe"] > 2 * good["fringe"]


@pytest.mark.parametrize(("column", "count"), [(50, 1), (12, 0), (20, 0)])
def test_dots_count_where_the_true_edit_changes_nothing(column, count):
    before = np.full((40, 60, 3), 0.3, np.float32)
    inside = np.zeros((40, 60), bool)
    inside[10:20, 8:16] = True
    after = before.copy()
    after[inside] = 0.1
    after[20:25, 8:30] = 0.25  # its shadow
    picture = after.copy()
    picture[22, column] = 0.9
    assert stray(picture, before, before, after, inside) == count


def test_colour_that_an_edit_leaves_and_spills():
    true = np.zeros((40, 40), bool)
    true[10:30, 10:30] = True
    photo = np.where(true[..., None], (1.0, 0, 0), (1.0, 1.0, 1.0))
    small, large = np.zeros((40, 40)), np.zeros((40, 40))
    small[12:28, 12:28] = 1
    large[8:32, 8:32] = 1
    # The inner 8 pixels from the border: of 400, less the 16 in the middle.
    left, spilt = colour_errors(small, true, photo, 9)
    assert (left, spilt) == (pytest.approx((400 - 256) / (400 - 16), abs=0.03), 0)
    # White has no colour.
    assert colour_errors(large, true, photo, 9) == (0, 0)
    left, spilt = colour_errors(large, true, photo[..., ::-1] * 0 + (0, 1.0, 0), 9)
    assert left == 0 and spilt == pytest.approx(176 / (400 - 16), abs=0.03)
