"""The camera between radiance and pixels."""

import numpy as np

from materialist.color import linear_to_srgb
from materialist.procedural.photographic import photographic


def scene():
    ramp = np.linspace(0, 1.6, 64, dtype=np.float32)
    return np.stack([np.tile(ramp, (48, 1)), np.tile(ramp[::-1] * 0.8, (48, 1)), np.full((48, 64), 0.3)], -1)


def test_the_result_is_what_eight_bits_hold_of_the_scene():
    image = np.clip(scene(), 0, 1).astype(np.float32)
    for k in range(30):
        out = photographic(scene(), np.random.default_rng(k))
        assert out.shape == (48, 64, 3) and out.dtype == np.float32
        levels = linear_to_srgb(out) * 255
        np.testing.assert_allclose(levels, np.rint(levels), atol=2e-3)
        assert np.corrcoef(out.ravel(), image.ravel())[0, 1] > 0.85
        assert 0.4 < out.mean() / image.mean() < 2.0
