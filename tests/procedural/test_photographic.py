"""The camera between radiance and pixels."""

import numpy as np

from materialist.color import linear_to_srgb
from materialist.procedural.photographic import photographic, white_balanced


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


def test_equal_states_give_equal_pictures_and_the_input_stays():
    image = scene()
    before = image.copy()
    a, b, c = (photographic(image, np.random.default_rng(k)) for k in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)
    assert np.array_equal(image, before)


def test_balance_pulls_a_cast_towards_grey_and_keeps_brightness():
    image = np.full((16, 16, 3), 0.3, np.float32) * np.array([1.3, 1.0, 0.7], np.float32)
    spread = lambda a: np.ptp(np.log(a.mean((0, 1))))  # noqa: E731
    out = [white_balanced(image, np.random.default_rng(k)) for k in range(40)]
    assert np.mean([spread(o) for o in out]) < spread(image)
    np.testing.assert_allclose([o.mean() for o in out], image.mean(), rtol=0.1)
