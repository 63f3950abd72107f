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


def test_values_stay_between_those_around():
    rng = np.random.default_rng(1)
    values, known = rng.random((33, 47)), rng.random((33, 47)) < 0.1
    found = membrane(values, known)
    assert found.min() >= values[known].min() - 1e-6 and found.max() <= values[known].max() + 1e-6
