"""Rims of renderings beside occlusions take the look of the surface that the photo shows."""

import numpy as np

from materialist.edits.composite.rims import settled

SIZE = 512
EDGE = 256  # column from which the depth has the thing in front
SEEN = 258  # column from which the photo shows it


def _scene():
    columns = np.broadcast_to(np.arange(SIZE), (SIZE, SIZE))
    depth = np.where(columns < EDGE, 4.0, 2.0)
    photo = np.where(columns < SEEN, 0.1, 0.6)[..., None] * np.ones(3)
    base = np.where(columns < EDGE, 0.2, 0.5)[..., None] * np.ones(3)
    edited = np.where(columns < EDGE, 0.2, 2.0)[..., None] * np.ones(3)
    return depth, photo, base, edited


def test_a_rim_that_the_photo_shows_as_the_background_is_lit_as_the_background():
    depth, photo, base, edited = _scene()
    assert (edited / base)[256, EDGE, 0] == 4  # the outline that would be seen
    rendered = settled([base, edited], depth, photo)
    factor = rendered[1] / rendered[0]
    np.testing.assert_allclose(factor[:, EDGE:SEEN], 1, atol=0.05)
    np.testing.assert_allclose(factor[:, SEEN], 4, rtol=0.05)


def test_away_from_occlusions_nothing_moves():
    depth, photo, base, edited = _scene()
    rendered = settled([base, edited], depth, photo)
    far = np.abs(np.arange(SIZE) - EDGE) > 0.02 * SIZE
    np.testing.assert_array_equal(rendered[1][:, far], edited[:, far].astype(np.float32))
    # A slope and a small step are no occlusions.
    slope = np.linspace(2, 4, SIZE)[None] * np.ones((SIZE, 1))
    rendered = settled([base, edited], slope, photo)
    np.testing.assert_array_equal(rendered[1], edited)


def test_the_border_of_the_sky_is_an_occlusion():
    depth, photo, base, edited = _scene()
    depth = np.where(depth == 4, 0, depth)
    rendered = settled([base, edited], depth, photo)
    np.testing.assert_allclose((rendered[1] / rendered[0])[:, EDGE:SEEN], 1, atol=0.05)


def test_where_no_pixel_is_trusted_all_stays():
    depth = np.where(np.indices((8, 8)).sum(0) % 2, 1.0, 3.0)
    picture = np.random.default_rng(0).uniform(0, 1, (8, 8, 3))
    same = settled([picture], depth, picture)[0]
    np.testing.assert_array_equal(same, picture)
