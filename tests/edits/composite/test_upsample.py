"""Enlarged layers follow the photo's edges."""

import numpy as np

from materialist.edits.composite.upsample import GuidedUpsample


def photo_of(mask, inside, outside):
    return np.where(mask[..., None], inside, outside).astype(np.float32)


def test_values_stay_on_their_side_of_an_edge_that_only_the_large_photo_resolves():
    # The true edge runs at native column 21, inside a working pixel (4 native ones each).
    native = np.zeros((40, 40), bool)
    native[:, :21] = True
    large = photo_of(native, (0.8, 0.2, 0.1), (0.1, 0.3, 0.7))
    small = large.reshape(10, 4, 10, 4, 3).mean((1, 3))
    layer = (np.arange(10) < 5).astype(np.float32)[None, :, None].repeat(10, 0)
    whole = slice(0, 40)
    out = GuidedUpsample(layer, small, (40, 40))(whole, whole, large)[..., 0]
    assert out[:, :20].min() > 0.9 and out[:, 22:].max() < 0.1
