"""Filled holes at native size: smooth outlines, the detail of the sources, the photo elsewhere."""

from dataclasses import replace

import numpy as np

from materialist.edits.remove.native import outline, with_hole
from materialist.types import Camera, Photo


def photo_of(large, factor):
    height, width = large.shape[0] // factor, large.shape[1] // factor
    small = large.reshape(height, factor, width, factor, 3).mean((1, 3)).astype(np.float32)
    return Photo(linear=small, original=large.astype(np.float32), camera=Camera(width, height, 45.0))


def test_the_outline_is_smooth_and_thin_holes_are_kept():
    rows, columns = np.mgrid[:40, :40] + 0.5
    share = outline(np.hypot(rows - 20, columns - 20) < 11, (320, 320))
    y, x = np.mgrid[:320, :320] + 0.5
    radius = np.hypot(y - 160, x - 160) / 8
    rim = (share > 0.3) & (share < 0.7)
    assert rim.sum() > 60 and radius[rim].std() < 0.25  # of whole pixels: 0.4
    assert (share[radius < 9.5] == 1).all() and not share[radius > 11.8].any()
    lines = np.zeros((40, 40), bool)
    lines[10], lines[20:22] = True, True
    assert outline(lines, (320, 320))[84].all() and outline(lines, (320, 320))[168].all(), "thin ones are kept"


def test_detail_comes_from_the_sources_and_the_rest_is_the_photo():
    factor = 4
    x = np.arange(48 * factor)[None].repeat(32 * factor, 0)
    fine = 0.4 + 0.2 * ((x % 4) < 2)[..., None] * np.ones(3)  # as wide as a working pixel: gone at working size
    photo = photo_of(fine, factor)
    hole = np.zeros((32, 48), bool)
    hole[10:20, 10:20] = True
    spoiled = fine.copy()
    spoiled[40:80, 40:80] = 0
    source = np.arange(hole.size).reshape(hole.shape) + 20 * hole
    photo = replace(photo, original=spoiled.astype(np.float32))
    found = with_hole(photo, photo.linear, hole, source)
    np.testing.assert_array_equal(found.original[:40], spoiled[:40].astype(np.float32))
    np.testing.assert_allclose(found.original[46:74, 46:74], fine[46:74, 46:74], atol=0.02)
