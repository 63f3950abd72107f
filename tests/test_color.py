"""Colour: the sRGB curve against its closed form, there and back, and whole levels by parts."""

import numpy as np
import pytest

from materialist import color
from materialist.color import linear_to_srgb, srgb_levels, srgb_to_linear, white_share


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


def test_white_is_told_from_paint():
    paint = np.array([[0.1, 0.4, 0.15], [0.5, 0.05, 0.05]])
    light = 2 * paint + np.array([[0.3], [0.1]])
    np.testing.assert_allclose(white_share(light, paint), [0.3, 0.1], rtol=0.25)
    # Of any length, and one for all.
    np.testing.assert_allclose(white_share(light, 7 * paint), white_share(light, paint), rtol=1e-6)
    np.testing.assert_allclose(white_share(light[:1], paint[0]), white_share(light, paint)[:1])


def test_grey_paint_has_no_white_and_no_channel_gives_more_than_it_has():
    grey = np.full(3, 0.5)
    assert white_share(1.5 * grey, grey) < 1e-6
    assert white_share(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])) == 0
