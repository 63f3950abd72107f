"""What JSON lacks becomes what it has."""

import json
from pathlib import Path

import numpy as np

from materialist.plain import plain


def test_numbers_arrays_and_what_is_not_finite():
    value = {
        1: np.float32(0.5),
        "a": np.arange(3),
        "b": (float("nan"), np.inf, True, None),
        "c": Path("x/y"),
        "d": {2},
    }
    found = json.loads(json.dumps(plain(value), allow_nan=False))
    assert found == {"1": 0.5, "a": [0, 1, 2], "b": [None, None, True, None], "c": "x/y", "d": [2]}
    assert plain(np.array([1.0, np.nan])) == [1.0, None]
