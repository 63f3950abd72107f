"""Crops of a photo lie where their windows are."""

import numpy as np
import pytest

from materialist.color import srgb_to_linear
from materialist.edits.select.crop import crop_around
from materialist.geometry.silhouette import window
from materialist.types import Camera, Photo


@pytest.mark.parametrize("native", [(300, 400), (1001, 1337), (2400, 3200), (3000, 4000)])
def test_a_crop_lies_where_its_window_is(native):
    """A ramp of columns and rows comes back to the pixels of the window, whatever the photo's size."""
    h, w = 300, 400
    mask = np.zeros((h, w), bool)
    mask[91:130, 203:277] = True
    down, across = (np.arange(n, dtype=np.float32) for n in native)
    # What a pixel of the photo has: its place in the working picture, in shares of its sides.
    places = np.stack(
        np.broadcast_arrays(
            ((across + 0.5) / native[1])[None], ((down + 0.5) / native[0])[:, None], np.float32(0)
        ),
        -1,
    )
    photo = Photo(np.zeros((h, w, 3), np.float32), Camera(w, h, 40.0), places.astype(np.float32))
    crop = crop_around(photo, mask, 10, 1024)
    assert max(crop.picture.shape) <= 1024
    around = window(mask, margin=10)
    ramps = srgb_to_linear(crop.picture).astype(np.float32)
    column = crop.at_working_size(ramps[..., 0], around) * w - 0.5
    row = crop.at_working_size(ramps[..., 1], around) * h - 0.5
    y, x = np.mgrid[around]
    inner = (slice(2, -2), slice(2, -2))
    np.testing.assert_allclose(column[inner], x[inner], atol=0.05)
    np.testing.assert_allclose(row[inner], y[inner], atol=0.05)
