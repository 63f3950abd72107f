"""Nouns that people build by hand, in Python: numbers of any kind, and a sentence for what is none."""

import numpy as np
import pytest

from materialist.errors import InputError
from materialist.types import Camera, Lamp


def test_numbers_of_any_kind_become_pythons():
    camera = Camera(np.int64(8), 6.0, np.float32(40))
    assert (camera.width, camera.height, camera.fov) == (8, 6, 40.0)
    assert [type(value) for value in (camera.width, camera.height, camera.fov)] == [int, int, float]
    lamp = Lamp(np.float32([0, 1, -2]), [3, 3, 3], np.array(0.5))
    assert lamp == Lamp((0.0, 1.0, -2.0), (3.0, 3.0, 3.0), 0.5) and type(lamp.radius) is float


@pytest.mark.parametrize(
    ("kind", "values", "words"),
    [
        *(
            (Camera, values, "whole numbers")
            for values in (
                (0, 6, 40),
                (8.5, 6, 40),
                (8, None, 40),
                ([8, 6], 6, 40),
                (np.inf, 6, 40),
            )
        ),
        *(
            (Camera, (8, 6, fov), "degrees between 0 and 180")
            for fov in (0, 180, -3, np.nan, "wide")
        ),
        *(
            (Lamp, values, "A lamp at")
            for values in (
                ((0, 0), (1, 1, 1), 1),
                (None, (1, 1, 1), 1),
                ((0, 0, 0), 5, 1),
                ((0, 0, 0), (1, -1, 1), 1),
                ((0, 0, 0), (1, 1, 1), 0),
                ((0, 0, np.nan), (1, 1, 1), 1),
                ((0, 0, 0), (1, 1, 1), "small"),
            )
        ),
    ],
)
def test_values_that_are_none(kind, values, words):
    with pytest.raises(InputError, match=words):
        kind(*values)
