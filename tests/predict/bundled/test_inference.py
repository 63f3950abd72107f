"""Which pixels have a surface."""

import numpy as np

from materialist.predict.bundled.inference import _surface

BLUE = (0.25, 0.4, 0.8)
CLOUD = (0.7, 0.75, 0.85)
GREEN = (0.1, 0.2, 0.05)
DARK = (0.01, 0.012, 0.01)


def valley():
    """Logit and photo [40, 60] of a sky over a meadow, with a cloud that might be a surface, and a dark pit that might
    be sky."""
    rng = np.random.default_rng(0)
    photo = np.empty((40, 60, 3), np.float32)
    logit = np.full((40, 60), 6.0, np.float32)
    photo[:20], photo[20:] = BLUE, GREEN
    logit[:20], logit[:20, :15] = -3, -7
    photo[3:9, 5:14], photo[4:12, 30:45], photo[24:30, 20:30] = CLOUD, CLOUD, DARK
    logit[4:12, 30:45], logit[20:30, 20:30] = -0.5, -2
    return logit, photo * rng.uniform(0.9, 1.1, photo.shape).astype(np.float32)


def test_clouds_are_sky_and_a_dark_place_is_not():
    surface = _surface(*valley())
    assert not surface[:20].any() and surface[20:].all()


def test_where_no_sky_is_sure_there_is_none():
    logit, photo = valley()
    assert _surface(np.maximum(logit, -4), photo).all()


def test_what_surely_is_a_surface_stays_one_in_the_colour_of_the_sky():
    logit, photo = valley()
    photo[32:38, 40:50] = BLUE
    assert _surface(logit, photo)[20:].all()


def test_a_picture_of_nothing_but_sky_has_no_surface():
    logit, photo = valley()
    assert not _surface(np.full_like(logit, -9), photo).any()
