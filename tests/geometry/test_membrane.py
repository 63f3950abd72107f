"""The membrane against functions that are harmonic."""

import numpy as np

from materialist.geometry.membrane import membrane


def test_linear_functions_are_carried_through_a_hole():
    y, x = np.mgrid[:60, :81].astype(float)
    truth = np.stack([2 * x - y, 0.3 * y + 5], -1)
    known = np.hypot(y - 30, x - 44) > 17
    found = membrane(np.where(known[..., None], truth, np.nan), known)
    np.testing.assert_array_equal(found[known], truth[known].astype(np.float32))
    assert np.abs(found - truth)[~known].max() < 0.04 * np.ptp(truth)
