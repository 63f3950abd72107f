"""Arrays that are handed to Dr.Jit."""

import numpy as np
import pytest

from materialist.buffers import floats, integers, tensor
from materialist.render.variant import setup


@pytest.mark.parametrize("count", [1, 5, 16, 1000])
def test_values_arrive_and_the_memory_goes_on(count):
    mi = setup("cpu")
    given = np.arange(count * 3, dtype=np.float64).reshape(count, 3)[::-1]
    np.testing.assert_array_equal(np.array(floats(mi, given)), given.ravel())
    np.testing.assert_array_equal(np.array(integers(mi, given.astype(np.int64))), given.ravel())
    assert tensor(mi, given).shape == (count, 3)
    np.testing.assert_array_equal(np.array(tensor(mi, given)), given)


def test_a_change_of_the_original_does_not_reach_dr_jit():
    mi = setup("cpu")
    given = np.ones(40, np.float32)
    copy = floats(mi, given)
    given[:] = 2
    np.testing.assert_array_equal(np.array(copy), 1)
