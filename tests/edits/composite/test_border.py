"""The path of a border along the photo's edges."""

import itertools

import numpy as np
import pytest

from materialist.edits.composite.border import _least_path, on_edges
from materialist.edits.composite.matte import _signed_distance

INSIDE = (0.9, 0.4, 0.1)
OUTSIDE = (0.1, 0.3, 0.6)


def disc(radius, size=60, centre=30.0):
    """[size, size] signed distance to a circle, > 0 inside."""
    rows, columns = np.mgrid[:size, :size] + 0.5
    return (radius - np.hypot(rows - centre, columns - centre)).astype(np.float32)


def circle_photo(radius, scale=4):
    """[60 scale, 60 scale, 3] linear: a disc of one colour before another, `scale` native pixels a working pixel."""
    fine = disc(radius * scale, 60 * scale, 30.0 * scale)
    return np.where(fine[..., None] > 0, INSIDE, OUTSIDE).astype(np.float32)


@pytest.mark.parametrize("radius", [18.2, 20.0, 21.7])
def test_a_border_moves_to_an_edge_within_reach(radius):
    mask = disc(20.0) > 0
    moved = on_edges(_signed_distance(mask, 0.5), circle_photo(radius), 8.0)
    near = np.abs(disc(radius)) < 2
    assert np.abs(moved - disc(radius))[near].mean() < 0.2
    assert np.abs(moved - disc(radius))[near].max() < 0.6


def test_far_from_the_border_nothing_moves():
    distance = _signed_distance(disc(20.0) > 0, 0.5)
    moved = on_edges(distance, circle_photo(21.7), 8.0)
    far = np.abs(distance) >= 8
    np.testing.assert_array_equal(moved[far], distance[far])


def test_on_an_even_photo_a_border_stays_and_loses_its_steps():
    distance = _signed_distance(disc(20.0) > 0, 0.5)
    moved = on_edges(distance, np.full((240, 240, 3), 0.3, np.float32), 8.0)
    on = np.abs(disc(20.0)) < 1
    before = np.abs(distance - disc(20.0))[on]
    after = np.abs(moved - disc(20.0))[on]
    assert after.mean() < 0.8 * before.mean() and after.max() < 0.5


def test_a_border_that_the_frame_cuts_moves_too():
    large = np.broadcast_to(np.float32(OUTSIDE), (80, 120, 3)).copy()
    large[:, :46] = INSIDE
    mask = np.zeros((20, 30), bool)
    mask[:, :10] = True  # the edge is 1.5 working pixels further
    moved = on_edges(_signed_distance(mask, 0.5), large, 8.0)
    columns = np.arange(30) + 0.5
    np.testing.assert_allclose(moved[:, 9:14], np.tile(11.5 - columns, (20, 1))[:, 9:14], atol=0.15)


def test_noise_does_not_bend_a_border():
    """Each point's own best offset would be wrong by 0.34 pixels in the mean."""
    noise = np.random.default_rng(3).normal(0, 0.15, (240, 240, 3))
    large = np.clip(0.3 + 0.2 * circle_photo(21.0) + noise, 0, 1).astype(np.float32)
    moved = on_edges(_signed_distance(disc(20.0) > 0, 0.5), large, 8.0)
    on = np.abs(disc(21.0)) < 1
    assert np.abs((moved - disc(21.0))[on]).mean() < 0.2


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("closed", [False, True])
def test_the_least_path_is_the_best_of_all_paths(closed, seed):
    cost = np.random.default_rng(seed).random((6, 4))
    bend = 0.2
    path = _least_path(cost.copy(), bend, closed)

    def total(columns):
        steps = np.diff([*columns, columns[0]] if closed else columns)
        return cost[range(6), columns].sum() + bend * (steps**2).sum()

    paths = itertools.product(range(4), repeat=6)
    if closed:
        # Its surest point is held.
        start = int((cost.min(1) - cost.mean(1)).argmin())
        paths = (p for p in paths if p[start] == cost[start].argmin())
    assert total(path) == pytest.approx(min(map(total, paths)))


def bar_photo(first, last, scale=4):
    """[60 scale, 60 scale, 3] linear: a vertical bar between two columns, working pixels."""
    columns = (np.arange(60 * scale) + 0.5) / scale
    inside = (columns > first) & (columns < last)
    row = np.where(inside[:, None], INSIDE, OUTSIDE).astype(np.float32)
    return np.broadcast_to(row, (60 * scale, 60 * scale, 3)).copy()


@pytest.mark.parametrize("width", [1, 2, 3])
@pytest.mark.parametrize("error", [0, 1, 2])
def test_the_borders_of_a_thin_thing_do_not_cross(width, error):
    mask = np.zeros((60, 60), bool)
    mask[:, 30 : 30 + width] = True
    moved = on_edges(_signed_distance(mask, 0.5), bar_photo(30 + error, 30 + width + error), 8.5)
    seen = (moved > 0).sum(1)
    assert (seen >= max(1, width - error)).all() and (seen <= width + 1).all()


def test_a_speck_does_not_take_the_offset_of_another_border():
    mask = disc(20.0) > 0
    mask[30, 30] = False
    before = _signed_distance(mask, 0.5)
    moved = on_edges(before, circle_photo(22.0), 8.5)
    np.testing.assert_allclose(moved[29:32, 29:32], before[29:32, 29:32], atol=0.1)


def test_an_exact_border_stays_at_any_scale():
    for width in (101, 115, 133, 149, 260):
        large = np.broadcast_to(np.float32(OUTSIDE), (width, width, 3)).copy()
        places = (np.arange(width) + 0.5) * 100 / width
        large[:, places < 43] = INSIDE
        mask = np.zeros((100, 100), bool)
        mask[:, :43] = True
        moved = on_edges(_signed_distance(mask, 0), large, 8.5)
        assert np.abs(moved[50, 40:46] - (43 - np.arange(40, 46) - 0.5)).max() < 0.26


@pytest.mark.parametrize("shape", [(1, 20), (20, 1), (2, 2)])
def test_a_picture_of_a_pixel_or_two_is_left_as_it_is(shape):
    distance = np.linspace(-1, 1, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    assert on_edges(distance, np.ones((*shape, 3), np.float32), 8.5) is distance
