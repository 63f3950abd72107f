"""Pieces without seams: closed forms of the level that borders give."""

import numpy as np
import pytest

from materialist.edits.remove.exemplar import Plan, exemplar_plan
from materialist.edits.remove.seamless import LEAST, MOST, seamless

SHAPE = (40, 80)
HOLE = np.zeros(SHAPE, bool)
HOLE[12:28, 20:40] = True


def plan_from(shift, label=None, hole=HOLE):
    """Every pixel of the hole takes what is `shift` (rows, columns) away."""
    rows, columns = np.nonzero(hole)
    source = (rows + shift[0]) * hole.shape[1] + columns + shift[1]
    return Plan(rows, columns, source, np.ones(len(rows), np.float32), hole, reach=0, label=label)


def colours(picture):
    return np.repeat(np.asarray(picture, float)[..., None], 3, -1)


def test_flat_pieces_take_the_level_of_the_border():
    picture = np.full(SHAPE, 0.6)
    picture[:, 41:] = 0.5
    found = seamless(plan_from((0, 22)), colours(picture))  # its pieces are 0.5
    np.testing.assert_allclose(found[HOLE], 0.6, atol=0.01)
    np.testing.assert_array_equal(found[~HOLE], colours(picture).astype(np.float32)[~HOLE])


def test_light_that_falls_off_is_a_factor_of_the_pattern():
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    light = np.exp(-0.01 * x - 0.005 * y)
    truth = colours(light * np.where((x // 2 + y // 2) % 2, 0.8, 0.4) - LEAST)
    plan = plan_from((0, 20))
    plain, found = plan.fill(truth), seamless(plan, truth)
    error = lambda v: np.sqrt(((v - truth)[HOLE] ** 2).mean())  # noqa: E731
    assert error(plain) > 0.05 and error(found) < 0.1 * error(plain)


def test_levels_do_not_cross_from_surface_to_surface():
    picture = np.full(SHAPE, 0.5)
    picture[:20], label = 0.55, np.zeros(SHAPE, int)
    label[:20] = 1
    picture[:, 41:] = 0.5  # what both halves are made of
    found = seamless(plan_from((0, 22), label), colours(picture))
    np.testing.assert_allclose(found[HOLE & (label == 1)], 0.55, atol=0.01)
    np.testing.assert_allclose(found[HOLE & (label == 0)], 0.5, atol=1e-3)


def test_another_thing_beside_the_hole_gives_no_level():
    picture = np.full(SHAPE, 0.5)
    picture[10:30, 15:20] = 0.05  # a dark post at its left
    found = seamless(plan_from((0, 20)), colours(picture))
    np.testing.assert_allclose(found[HOLE], 0.5, atol=1e-3)


@pytest.mark.parametrize("place", [np.s_[:10, :10], np.s_[30:, 50:], np.s_[:, 25:35]])
def test_holes_at_the_frame_are_solved_too(place):
    rng = np.random.default_rng(0)
    picture = rng.uniform(0, 1, (*SHAPE, 3))
    hole = np.zeros(SHAPE, bool)
    hole[place] = True
    plan = exemplar_plan(picture, hole, np.ones(SHAPE, bool), np.zeros(SHAPE, int))
    found = seamless(plan, picture)
    assert np.isfinite(found).all() and (found >= 0).all() and found[hole].max() < 3


def test_pieces_that_contradict_each_other_stay_near_their_own_levels():
    """Sources at random over a picture of harsh steps: gradients that belong to no picture."""
    rng = np.random.default_rng(1)
    picture = np.where(rng.random((*SHAPE, 1)) < 0.5, 0.0, 50.0) * np.ones(3)
    rows, columns = np.nonzero(HOLE)
    known = np.flatnonzero(~HOLE)
    plan = Plan(rows, columns, rng.choice(known, len(rows)), np.ones(len(rows), np.float32), HOLE, reach=0)
    found, plain = seamless(plan, picture), plan.fill(picture)
    off = np.abs(np.log(found + LEAST) - np.log(plain + LEAST))
    assert off.max() <= MOST + 1e-4 and off[HOLE].max() > 0.3
