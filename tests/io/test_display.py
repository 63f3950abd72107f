"""Maps as pictures: what is shown bright, dark and black."""

import numpy as np

from materialist.color import luminance
from materialist.io import display


def test_the_ramp_rises_evenly_from_black():
    shown = display.ramp(np.linspace(0, 1, 256)[None])
    light = luminance((shown[0] / 255.0) ** 2.2) ** (1 / 3)
    assert shown[0, 0].max() < 10
    assert (np.diff(light[::16]) > 0).all()
    np.testing.assert_array_equal(display.grey(np.array([[0.5]])), [[[128, 128, 128]]])


def test_normals_are_coloured_and_nothing_is_black():
    normal = np.array([[[0, 0, 1], [1, 0, 0], [0, 0, 0]]], np.float32)
    np.testing.assert_array_equal(display.normals(normal), [[[128, 128, 255], [255, 128, 128], [0, 0, 0]]])


def test_the_exposure_of_light_does_not_show_its_unit_and_keeps_a_sun():
    envmap = np.full((8, 16, 3), 0.3, np.float32)
    envmap[2, 5] = 3000
    shown = display.light(envmap)
    np.testing.assert_array_equal(shown, display.light(100 * envmap))
    assert shown[2, 5].min() > shown[7, 0].max()
