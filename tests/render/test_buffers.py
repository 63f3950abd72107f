"""Arrays that are handed to Dr.Jit."""

import numpy as np

from materialist.buffers import floats
from materialist.render.variant import setup


def test_a_change_of_the_original_does_not_reach_dr_jit():
    mi = setup("cpu")
    given = np.ones(40, np.float32)
    copy = floats(mi, given)
    given[:] = 2
    np.testing.assert_array_equal(np.array(copy), 1)
