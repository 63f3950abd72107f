"""Filling by patches: what repeats is found again, and other surfaces are left alone."""

import numpy as np
import pytest

from materialist.edits.remove.exemplar import exemplar_plan


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
    plan = exemplar_plan(broken, hole, everywhere, one, seed=1)
    found = plan.fill(broken)
    np.testing.assert_array_equal(found[~hole], broken[~hole].astype(np.float32))
    assert np.abs(found - picture)[hole].mean() < 0.05  # the mean colour alone is 0.26 off
    other = plan.fill(np.arange(hole.size, dtype=np.float32).reshape(*hole.shape, 1))
    assert not np.isin(other[hole], np.flatnonzero(hole)).all(), "other maps come from the same places"


def test_nothing_is_copied_from_another_surface():
    rng = np.random.default_rng(0)
    picture = rng.uniform(0.4, 0.6, (64, 80, 3)).astype(np.float32)
    label = np.zeros((64, 80), int)
    label[:, 40:] = 1
    picture[..., 0] = np.where(label, 0.1, 0.9)
    hole = hole_in(label.shape, 20, 28, 22, 26)
    plan = exemplar_plan(np.where(hole[..., None], 0.5, picture), hole, np.ones_like(hole), label)
    red = plan.fill(picture)[..., 0]
    deep = hole & (np.abs(np.arange(80) - 39.5) > 3)
    assert np.abs(red - picture[..., 0])[deep].max() < 0.1


def test_the_same_seed_gives_the_same_plan_and_no_source_gives_none():
    picture, hole = stripes(), hole_in((72, 96))
    one = np.zeros(hole.shape, int)
    a, b = (exemplar_plan(picture, hole, np.ones_like(hole), one, seed=3) for _ in range(2))
    np.testing.assert_array_equal(a.source, b.source)
    assert exemplar_plan(picture, hole, np.zeros_like(hole), one) is None


def test_large_pictures_are_matched_small_and_keep_their_pieces():
    picture = np.tile(stripes(64, 80, 16), (5, 5, 1))  # above the finest size at which patches are compared
    hole = hole_in(picture.shape[:2], 120, 150, 60, 70)
    plan = exemplar_plan(np.where(hole[..., None], 0, picture), hole, np.ones_like(hole), np.zeros(hole.shape, int))
    found = plan.fill(np.where(hole[..., None], 0, picture))
    assert np.abs(found - picture)[hole].mean() < 0.1


def test_a_slanting_border_of_surfaces_stays_where_it_is():
    """A patch across the border is only right where both have it in the same place."""
    rows, columns = np.indices((72, 96))
    label = (rows > 40 - columns / 12).astype(int)
    wall = np.where(((rows + columns) % 10 < 4)[..., None], [0.3, 0.4, 0.6], [0.7, 0.7, 0.9])
    hole = (np.abs(columns - 46) < 0.45 * (rows - 10)) & (rows < 62)
    strange = []
    for seed in range(8):  # the search is by chance
        rng = np.random.default_rng(seed)
        dots = np.zeros((72, 96), bool)
        dots[rng.integers(44, 72, 60), rng.integers(0, 96, 60)] = True
        floor = np.where(dots[..., None], [0.9, 0.9, 0.3], [0.4, 0.05, 0.1])
        picture = np.where(label[..., None] == 1, floor, wall).astype(np.float32)
        plan = exemplar_plan(np.where(hole[..., None], 0.5, picture), hole, ~hole, label, seed=seed)
        blue = plan.fill(picture)[..., 2]
        # The wall's paler blue on the floor, the floor's red on the wall.
        strange.append(((label == 1) & (blue > 0.55) | (label == 0) & (blue < 0.3))[hole].mean())
    assert np.mean(strange) < 0.0018 and max(strange) < 0.003, strange


def test_a_hole_in_a_narrow_ring_is_filled_from_the_ring():
    """At the coarsest size no patch lies in the ring alone; then the search begins at a finer one."""
    rng = np.random.default_rng(0)
    rows, columns = np.mgrid[:282, :512]
    away = np.hypot((rows - 141) / 100, (columns - 256) / 170)
    light, dark = np.array([0.85, 0.87, 0.8]), np.array([0.25, 0.25, 0.28])
    picture = np.where((away < 1)[..., None], light, dark) + rng.normal(0, 0.02, (282, 512, 1))
    hole = away < 0.62
    plan = exemplar_plan(picture.astype(np.float32), hole, ~hole, np.zeros(hole.shape, int))
    filled = plan.fill(np.where(hole[..., None], 0, picture))
    assert np.abs(filled[hole] - light).mean() < 0.05


@pytest.mark.parametrize("width", [1, 2, 4])
@pytest.mark.parametrize("left", [31, 100, 201])
def test_a_thin_hole_is_filled(width, left):
    """A pole is none at a quarter of the size."""
    picture = np.tile(stripes(200, 512, 40).mean(1, keepdims=True), (1, 512, 1)) + 0.1
    picture[100:] = [0.2, 0.5, 0.4]
    hole = hole_in(picture.shape[:2], 30, left, 150, width)
    broken = np.where(hole[..., None], 0.9, picture)
    plan = exemplar_plan(broken, hole, np.ones_like(hole), np.zeros(hole.shape, int))
    if plan is not None:  # the caller has a membrane for where nothing can be copied
        np.testing.assert_allclose(plan.fill(broken), picture, atol=0.1)


def test_what_no_patch_fits_takes_what_is_next_to_it():
    """A pattern tells all of a hole but a line."""
    picture = stripes(200, 512)
    hole = hole_in(picture.shape[:2], 60, 200, 80, 41)
    told = np.full(hole.shape, -1)
    rows, columns = np.nonzero(hole)
    told[rows, columns] = rows * 512 + columns - 80
    told[60:140, 220] = -1
    plan = exemplar_plan(np.where(hole[..., None], 0.9, picture), hole, np.ones_like(hole), 0 * told, told=told)
    found = plan.fill(np.where(hole[..., None], 0.9, picture))
    others = hole & (np.arange(512) != 220)
    np.testing.assert_allclose(found[others], picture[others], atol=1e-6)
    assert found[hole].max() < 0.85, "nothing of the object is left"
