"""Glare of lamps."""

import numpy as np
import pytest

from materialist.edits.composite.glare import WIDTHS, add_glare


@pytest.mark.parametrize("size", [(120, 160), (1500, 2000)])
def test_a_lens_scatters_its_share_of_the_light_round_the_lamp(size):
    height, width = size
    side = width // 20
    box = (slice(height // 2, height // 2 + side), slice(width // 2, width // 2 + side))
    picture = np.full((height, width, 3), 0.25, np.float32)
    light = np.broadcast_to(np.float32([3, 2, 1]), (side, side, 3)).copy()
    add_glare(picture, light, box)
    added = picture - 0.25
    # Nearly all of it falls into the frame.
    np.testing.assert_allclose(
        added.sum((0, 1)), sum(share for _, share in WIDTHS) * light.sum((0, 1)), rtol=0.05
    )
    row, column = np.unravel_index(added[..., 0].argmax(), (height, width))
    middle = (height // 2 + side / 2, width // 2 + side / 2)
    assert np.hypot(row - middle[0], column - middle[1]) < 0.02 * width
    assert added.min() >= 0


def test_a_lamp_at_the_frames_corner():
    picture = np.zeros((90, 1000, 3), np.float32)
    add_glare(picture, np.ones((3, 2, 3), np.float32), (slice(87, 90), slice(998, 1000)))
    assert picture[-1, -1, 0] == picture.max() > 0
