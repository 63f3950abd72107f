"""Regions without strays: what is too small joins the neighbour it fits best."""

import numpy as np
import pytest

from materialist.geometry.regions import connected_regions, regions_without_strays

ROW = np.arange(8)
PAIRS = (ROW[:-1], ROW[1:])


def _steps(values):
    return np.abs(np.diff(np.asarray(values, float)))


def test_a_stray_joins_the_neighbour_at_the_smaller_step():
    step = _steps([0, 0, 0, 4, 5, 5, 5, 5])
    region, linked = regions_without_strays(PAIRS, step < 0.5, step, 2, 8)
    assert linked.tolist() == [True, True, False, True, True, True, True]
    assert len(set(region)) == 2 and region[3] == region[4]


def test_strays_side_by_side_end_in_one_large_region():
    step = _steps([0, 0, 0, 0, 10, 11, 13, 16])
    region, linked = regions_without_strays(PAIRS, step < 0.5, step, 3, 8)
    assert len(set(region)) == 2 and not linked[3]


@pytest.mark.parametrize("least", [1, 4])
def test_regions_that_are_large_enough_stay(least):
    step = _steps([0, 0, 0, 0, 9, 9, 9, 9])
    region, linked = regions_without_strays(PAIRS, step < 0.5, step, least, 8)
    np.testing.assert_array_equal(linked, step < 0.5)
    assert region.tolist() == [0] * 4 + [1] * 4


def test_a_region_without_neighbours_stays():
    pairs = (np.array([0, 1]), np.array([1, 2]))
    region, _ = regions_without_strays(pairs, np.ones(2, bool), np.zeros(2), 3, 4)
    assert region.tolist() == [0, 0, 0, 1]


def test_pairs_that_are_not_linked_connect_nothing():
    region = connected_regions(PAIRS, np.arange(7) != 2, 8)
    assert region.tolist() == [0] * 3 + [1] * 5


def test_a_rim_between_two_sides_of_one_region_is_held_by_the_nearer():
    # Members 0 to 3 and 5 to 7 are one region round about; 4 is the rim, nearer to 3.
    first = np.array([0, 1, 2, 3, 4, 5, 6, 0])
    second = np.array([1, 2, 3, 4, 5, 6, 7, 7])
    step = np.array([0, 0, 0, 1.0, 6, 0, 0, 0])
    region, linked = regions_without_strays((first, second), step < 0.5, step, 2, 8)
    assert len(set(region)) == 1
    assert linked[3] and not linked[4]
