"""Points that fill the square."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from materialist.transport.cache import point

N = 1 << 14


@pytest.fixture(scope="module")
def lattice():
    return point(dr.arange(mi.UInt32, N), dr.opaque(mi.UInt32, N), mi.Point2f(0.2, 0.7))


def test_points_fill_the_square(lattice):
    """Every cell of a 64 x 64 grid holds 4 points, give or take one a side: far more even than random."""
    x, y = np.array(lattice)
    assert x.min() >= 0 and y.min() >= 0 and x.max() < 1 and y.max() < 1
    counts, _, _ = np.histogram2d(x, y, bins=64, range=[[0, 1], [0, 1]])
    assert counts.min() >= 2 and counts.max() <= 6
