"""How large the network sees a photo: by how far its edges are apart."""

import numpy as np
import pytest

from materialist.predict.bundled import views


def _stripes(size, period):
    """[size, size, 3] black and white bars, an edge every `period` / 2 pixels, half a bar at either side."""
    bars = ((np.arange(size) + period // 4) // (period // 2)) % 2
    return np.broadcast_to(bars[None, :, None], (size, size, 3)).astype(np.float32)


@pytest.mark.parametrize("period", [64, 128])
def test_spacing_of_bars(period):
    # Pixels are evenly spread from an edge to the middle of a bar, less the blurred edge's own width.
    assert views.spacing(_stripes(256, period)) == pytest.approx(0.9 * period / 4, abs=2.5)


def test_spacing_does_not_depend_on_the_photos_size():
    fine = _stripes(768, 192)
    assert views.spacing(fine) == pytest.approx(views.spacing(_stripes(256, 64)), rel=0.1)
    assert views.spacing(fine[:384]) == pytest.approx(views.spacing(fine), rel=0.1)


def test_a_small_photo_is_judged_by_its_share_not_its_pixels():
    assert views.spacing(_stripes(128, 32)) == pytest.approx(views.spacing(_stripes(256, 64)), rel=0.15)


def test_bare_photos_are_seen_as_the_training_pictures():
    assert views.sides(np.full((300, 400, 3), 0.4, np.float32), 400) == views.PLAIN
    assert views.sides(_stripes(256, 512), 2000) == views.PLAIN


def test_crowded_photos_are_seen_larger_but_not_too_large():
    crowded = views.sides(_stripes(512, 192), 512)
    assert views.PLAIN[1] < crowded[1] < views.LARGEST * views.PLAIN[1]
    assert crowded[0] / crowded[1] == pytest.approx(views.PLAIN[0] / views.PLAIN[1], rel=0.01)
    assert views.sides(_stripes(512, 16), 512) == tuple(round(views.LARGEST * s) for s in views.PLAIN)


def test_grain_is_no_edge():
    grain = 0.4 + 0.04 * np.random.default_rng(0).normal(size=(256, 256, 3))
    assert views.sides(grain.astype(np.float32), 2000) == views.PLAIN


def test_one_pixel():
    assert views.sides(np.zeros((1, 1, 3), np.float32), 1) == views.PLAIN


@pytest.mark.parametrize(
    "longest, expected", [(100, (192, 384)), (256, (192, 384)), (384, (288, 576)), (2000, (384, 768))]
)
def test_the_whole_is_seen_smaller_than_there_are_pixels(longest, expected):
    """A crowded photo of 256 pixels is seen at 192 and 256, not at 256 twice."""
    assert views.sides(_stripes(256, 8), longest) == expected
