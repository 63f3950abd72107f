"""Lone bright pixels are brought down, and their light is spread where it must not be lost."""

import numpy as np
import pytest

from materialist.edits.composite.fireflies import without_fireflies


def test_a_lone_bright_pixel_is_brought_down_and_a_highlight_stays():
    picture = np.full((9, 9, 3), 0.5, np.float32)
    picture[2, 2] = (40, 20, 10)
    picture[6, 5:7] = 30
    clean = without_fireflies(picture)
    assert clean[2, 2].max() < 3 and clean[2, 2, 0] / clean[2, 2, 2] == pytest.approx(4, rel=1e-5)
    assert (clean[6, 5:7] > 1.4).all() and (clean <= picture + 1e-6).all()
    highlight = np.full((9, 9, 3), 0.5, np.float32)
    highlight[5:7, 5:7] = 30
    np.testing.assert_array_equal(without_fireflies(highlight), highlight)
    where = np.zeros((9, 9), bool)
    np.testing.assert_array_equal(without_fireflies(picture, where), picture)


def test_light_that_must_not_be_lost_is_spread():
    """Beside glass that lamps stand by, lone paths are all the light there is: none of it goes, and none leaves."""
    rng = np.random.default_rng(0)
    picture = np.full((60, 80, 3), 0.02, np.float32)
    picture[rng.random((60, 80)) < 0.03] = [30, 20, 10]
    where = np.zeros((60, 80), bool)
    where[5:55, 10:70] = True
    found = without_fireflies(picture, where, spread=True)
    assert np.allclose(found[where].sum(0), picture[where].sum(0), rtol=1e-3)
    np.testing.assert_array_equal(found[~where], picture[~where])
    assert found[where].std() < 0.3 * picture[where].std()
    assert without_fireflies(picture, where)[where].sum() < 0.2 * picture[where].sum(), "else it is lost"
