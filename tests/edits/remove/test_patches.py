"""Filling by patches: what repeats is found again, edges cross the hole, nothing comes from what may not be copied."""

import numpy as np

from materialist.edits.remove.patches import patched


def hole_in(shape, top=24, left=30, height=20, width=24):
    hole = np.zeros(shape, bool)
    hole[top : top + height, left : left + width] = True
    return hole


def stripes(height=72, width=96, period=8):
    x = np.arange(width) + 0 * np.arange(height)[:, None]
    one = ((x // (period // 2)) % 2).astype(np.float32)
    return np.stack([0.2 + 0.6 * one, 0.5 - 0.3 * one, 0.3 + 0 * one], -1)


def filled(picture, hole, usable=None, label=None):
    """What was in the hole is spoiled first."""
    usable = ~hole if usable is None else usable
    label = 0 * hole if label is None else label
    return patched(np.where(hole[..., None], 0.9, picture), hole, usable, label, seed=1)


def test_stripes_go_on_through_the_hole():
    picture = stripes()
    hole = hole_in((72, 96))
    found = filled(picture, hole)
    np.testing.assert_array_equal(found[~hole], picture[~hole].astype(np.float32))
    assert np.abs(found - picture)[hole].mean() < 0.05  # the mean colour alone is 0.26 off


def test_a_slanting_edge_of_two_textures_crosses_the_hole():
    rng = np.random.default_rng(0)
    rows, columns = np.indices((96, 128))
    below = rows > 46 - columns / 8
    picture = np.where(below[..., None], [0.5, 0.2, 0.1], [0.3, 0.4, 0.6]) * rng.uniform(
        0.85, 1.15, (96, 128, 1)
    )
    hole = np.hypot(rows - 40, columns - 64) < 16
    for label in (None, below.astype(int)):
        found = filled(picture, hole, label=label)
        assert ((found[..., 0] > found[..., 2]) != below)[hole].mean() < 0.05, (
            "of the hole's outline nothing stays"
        )
        assert found[hole & below].std(0).mean() > 0.3 * picture[below & ~hole].std(0).mean()


def test_nothing_is_copied_from_what_may_not_be():
    rng = np.random.default_rng(0)
    picture = rng.uniform(0.3, 0.5, (72, 96, 3))
    picture[:, 60:] = [0.9, 0.1, 0.1]
    hole = hole_in((72, 96))
    usable = np.broadcast_to(np.arange(96) < 58, (72, 96))
    assert filled(picture, hole, usable)[hole][:, 0].max() < 0.6


def test_no_other_thing_is_copied_from_far_away():
    """A thing that has the colours of the wall, and dots."""
    rng = np.random.default_rng(0)
    picture = np.full((72, 128, 3), 0.4)
    thing = np.broadcast_to(np.arange(128) >= 90, (72, 128))
    picture[thing & (rng.random((72, 128)) < 0.3)] = 0.1
    hole = hole_in((72, 128), left=40)
    assert (filled(picture, hole, label=np.where(thing, -1, 0))[hole] < 0.25).mean() < 0.01


def test_hdr_values_stay_and_odd_holes_are_filled():
    bright = 40 * stripes()
    hole = hole_in((72, 96))
    assert np.abs(filled(bright, hole) / bright - 1)[hole].mean() < 0.15
    for place in (np.s_[:70], np.s_[:, 1:], np.s_[30:, 50:]):
        most = np.zeros((72, 96), bool)
        most[place] = True
        found = filled(stripes(), most)
        assert np.isfinite(found).all() and found[most].min() > 0.1, (
            "black is no colour of the photo"
        )


def test_black_of_the_photo_is_copied():
    hole = hole_in((72, 96))
    bright = np.indices(hole.shape)[0] >= 40
    picture = 0.8 * np.repeat(bright[..., None], 3, -1)
    assert filled(picture, hole)[hole & ~bright].max() < 0.01
