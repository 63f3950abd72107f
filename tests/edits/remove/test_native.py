"""Outlines of filled holes at native size."""

import numpy as np

from materialist.edits.remove.native import outline


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
