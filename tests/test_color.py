"""Colour: the sRGB curve against its closed form, there and back, and whole levels by parts."""

import numpy as np
import pytest

from materialist import color
from materialist.color import linear_to_srgb, srgb_levels, srgb_to_linear


def test_the_curve_has_the_standard_values():
    assert linear_to_srgb(np.array([0.0, 0.0031308, 0.18, 1.0, 7.0])) == pytest.approx(
        [0, 0.04045, 0.46136, 1, 1], abs=1e-4
    )
    assert srgb_to_linear(np.array([0.0, 0.5, 1.0])) == pytest.approx([0, 0.21404, 1], abs=1e-5)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_every_level_comes_back(dtype, monkeypatch):
    monkeypatch.setattr(color, "ROWS", 7)  # not a divisor of the number of rows
    top = np.iinfo(dtype).max
    levels = np.arange(top + 1, dtype=dtype).reshape(64, -1)
    decoded = srgb_to_linear(levels)
    np.testing.assert_array_equal(
        decoded, srgb_to_linear(levels.astype(np.float32) / np.float32(top))
    )
    found = srgb_levels(decoded, dtype)
    assert found.dtype == dtype
    np.testing.assert_array_equal(found, levels)


def test_what_is_brighter_than_white_is_white():
    assert srgb_levels(np.array([[-1.0, 0, 2]])).tolist() == [[0, 0, 255]]
