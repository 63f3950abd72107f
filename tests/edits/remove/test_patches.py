"""Filling by patches: what repeats is found again, other surfaces are left alone, and levels follow the border."""

import numpy as np
import pytest

from materialist.edits.remove.filling import BlendSettings, seamless
from materialist.edits.remove.patches import copied, patch_sources

SHAPE = (40, 80)
HOLE = np.zeros(SHAPE, bool)
HOLE[12:28, 20:40] = True


def stripes(height=72, width=96, period=8):
    x = np.arange(width) + 0 * np.arange(height)[:, None]
    one = ((x // (period // 2)) % 2).astype(np.float32)
    return np.stack([0.2 + 0.6 * one, 0.5 - 0.3 * one, 0.3 + 0 * one], -1)


def hole_in(shape, top=24, left=30, height=20, width=24):
    hole = np.zeros(shape, bool)
    hole[top : top + height, left : left + width] = True
    return hole


def test_stripes_go_on_through_the_hole():
    picture = stripes()
    hole = hole_in(picture.shape[:2])
    broken = np.where(hole[..., None], 0.9, picture)
    everywhere, one = np.ones_like(hole), np.zeros(hole.shape, int)
    source = patch_sources(broken, hole, everywhere, one, seed=1)
    found = copied(broken, source)
    np.testing.assert_array_equal(found[~hole], broken[~hole].astype(np.float32))
    assert np.abs(found - picture)[hole].mean() < 0.05  # the mean colour alone is 0.26 off
    assert not hole.ravel()[source].any(), "nothing is copied out of the hole"


def test_nothing_is_copied_from_another_surface():
    rng = np.random.default_rng(0)
    picture = rng.uniform(0.4, 0.6, (64, 80, 3)).astype(np.float32)
    label = np.zeros((64, 80), int)
    label[:, 40:] = 1
    picture[..., 0] = np.where(label, 0.1, 0.9)
    hole = hole_in(label.shape, 20, 28, 22, 26)
    source = patch_sources(np.where(hole[..., None], 0.5, picture), hole, np.ones_like(hole), label)
    red = copied(picture, source)[..., 0]
    deep = hole & (np.abs(np.arange(80) - 39.5) > 3)
    assert np.abs(red - picture[..., 0])[deep].max() < 0.1


def test_a_slanting_border_of_surfaces_stays_where_it_is():
    """A patch across the border is only right where both have it in the same place."""
    rows, columns = np.indices((72, 96))
    label = (rows > 40 - columns / 12).astype(int)
    wall = np.where(((rows + columns) % 10 < 4)[..., None], [0.3, 0.4, 0.6], [0.7, 0.7, 0.9])
    hole = (np.abs(columns - 46) < 0.45 * (rows - 10)) & (rows < 62)
    strange = []
    for seed in range(4):  # the search is by chance
        rng = np.random.default_rng(seed)
        dots = np.zeros((72, 96), bool)
        dots[rng.integers(44, 72, 60), rng.integers(0, 96, 60)] = True
        floor = np.where(dots[..., None], [0.9, 0.9, 0.3], [0.4, 0.05, 0.1])
        picture = np.where(label[..., None] == 1, floor, wall).astype(np.float32)
        source = patch_sources(np.where(hole[..., None], 0.5, picture), hole, ~hole, label, seed=seed)
        blue = copied(picture, source)[..., 2]
        # The wall's paler blue on the floor, the floor's red on the wall.
        strange.append(((label == 1) & (blue > 0.55) | (label == 0) & (blue < 0.3))[hole].mean())
    assert np.mean(strange) < 0.0018 and max(strange) < 0.003, strange


def test_what_no_patch_fits_takes_what_is_next_to_it():
    """A pattern tells all of a hole but a line."""
    picture = stripes(200, 512)
    hole = hole_in(picture.shape[:2], 60, 200, 80, 41)
    told = np.full(hole.shape, -1)
    rows, columns = np.nonzero(hole)
    told[rows, columns] = rows * 512 + columns - 80
    told[60:140, 220] = -1
    broken = np.where(hole[..., None], 0.9, picture)
    found = copied(broken, patch_sources(broken, hole, np.ones_like(hole), 0 * told, known=told))
    others = hole & (np.arange(512) != 220)
    np.testing.assert_allclose(found[others], picture[others], atol=1e-6)
    assert found[hole].max() < 0.85, "nothing of the object is left"


def sources_from(shift):
    """Every pixel of the hole takes what is `shift` (rows, columns) away."""
    own = np.arange(HOLE.size).reshape(SHAPE)
    return np.where(HOLE, own + shift[0] * SHAPE[1] + shift[1], own)


ONE = np.zeros(SHAPE, int)


def colours(picture):
    return np.repeat(np.asarray(picture, float)[..., None], 3, -1)


def test_light_that_falls_off_is_a_factor_of_the_pattern():
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = np.exp(-0.01 * x - 0.005 * y)
    truth = colours(light * np.where((x // 2 + y // 2) % 2, 0.8, 0.4) - BlendSettings().floor)
    source = sources_from((0, 20))
    plain, found = copied(truth, source), seamless(truth, HOLE, source, ONE)
    error = lambda v: np.sqrt(((v - truth)[HOLE] ** 2).mean())  # noqa: E731
    assert error(plain) > 0.05 and error(found) < 0.1 * error(plain)


@pytest.mark.parametrize("place", [np.s_[30:, 50:], np.s_[:, 25:35]])
def test_holes_at_the_frame_are_solved_too(place):
    rng = np.random.default_rng(0)
    picture = rng.uniform(0, 1, (*SHAPE, 3))
    hole = np.zeros(SHAPE, bool)
    hole[place] = True
    found = seamless(picture, hole, patch_sources(picture, hole, np.ones(SHAPE, bool), ONE), ONE)
    assert np.isfinite(found).all() and (found >= 0).all() and found[hole].max() < 3
