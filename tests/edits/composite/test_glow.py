"""Where a light of the photo ends: at edges, else gradually."""

from dataclasses import replace

import numpy as np
from edit_scenes import flat_scene

from materialist.edits.composite.glow import glow, light_share
from materialist.edits.composite.matte import matte

LIGHT = np.zeros((80, 120), bool)
LIGHT[30:50, 40:80] = True


def test_it_fades_where_the_photo_is_smooth_and_ends_at_edges():
    photo = np.full((80, 120, 3), 0.9, np.float32)
    photo[:30] = 0.2  # an edge at the upper side
    share = glow(LIGHT, photo)
    assert (share[LIGHT] == 1).all() and share[:29].max() < 0.05
    beside = share[40, 80:90]
    assert (np.diff(beside) <= 0).all() and 0.2 < beside[0] < 1 and beside[-1] == 0
    np.testing.assert_allclose(share[40, 39:30:-1], beside[:9], atol=1e-5)


def test_a_dimmed_glow_has_no_saw_at_its_border():
    """A ragged part of an overexposed wall: from pixel to pixel the share changes less than by the matte alone."""
    scene = flat_scene(80, 120, native=3)
    rng = np.random.default_rng(1)
    ragged = LIGHT.copy()
    ragged[28:30, 40:80] = rng.random((2, 40)) < 0.5
    large = np.full((240, 360, 3), 0.9, np.float32)
    photo = replace(scene.photo, linear=large[::3, ::3].copy(), original=large)
    share = light_share(ragged, photo)
    hard = matte(ragged, large)
    assert share.shape == (240, 360) and share.min() == 0 and share.max() == 1

    def step(values):
        return np.abs(np.diff(values, axis=0)).max()

    assert step(share) < 0.7 * step(hard)


def test_nothing_and_everything():
    photo = np.full((80, 120, 3), 0.9, np.float32)
    assert not glow(np.zeros_like(LIGHT), photo).any()
    assert (glow(np.ones_like(LIGHT), photo) == 1).all()
