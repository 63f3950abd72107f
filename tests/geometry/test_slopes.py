"""Slopes of log depth from normals, against the depth of a plane."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.slopes import between, least_squares_change, slopes
from materialist.types import Camera


def test_a_plane_has_the_slopes_of_its_depth():
    rays = pixel_rays(Camera(160, 120, 40.0))
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    log_depth = np.log(-2.0 / (rays @ normal))
    across, down = slopes(np.broadcast_to(normal, rays.shape), rays)
    assert np.abs((across[:, 1:] + across[:, :-1]) / 2 - np.diff(log_depth, axis=1)).max() < 1e-6
    assert np.abs((down[1:] + down[:-1]) / 2 - np.diff(log_depth, axis=0)).max() < 1e-6
    same = slopes(np.broadcast_to(normal, rays.shape), rays[..., :2])
    np.testing.assert_array_equal(same[0], across)


def test_a_grazing_normal_gives_a_finite_slope():
    rays = pixel_rays(Camera(32, 24, 40.0))
    away = np.broadcast_to(np.array([1.0, 0, 0]), rays.shape)
    assert np.isfinite(slopes(away, rays)).all()


def test_neighbours_share_the_mean_of_their_slopes():
    across, down = np.arange(6.0).reshape(2, 3), np.array([[0.0, 2, 4], [10, 12, 14]])
    (left, right, along), (above, below, along_columns) = between((across, down))
    np.testing.assert_array_equal(along, [[0.5, 1.5], [3.5, 4.5]])
    np.testing.assert_array_equal(along_columns, [[5, 7, 9]])
    assert across[left].shape == across[right].shape == along.shape
    assert (across[right] - across[left] == 1).all() and (down[below] - down[above] == 10).all()


def test_the_change_solves_the_dense_least_squares_problem():
    rng = np.random.default_rng(0)
    count, first, second = 12, np.arange(11), np.arange(1, 12)
    first, second = np.r_[first, 0, 3], np.r_[second, 7, 11]
    wanted, weight, pull = rng.normal(size=13), rng.uniform(0.01, 2, 13), rng.uniform(0.1, 1, count)
    found = least_squares_change(first, second, wanted, weight, pull, rtol=1e-12, maxiter=200)
    rows = np.zeros((13, count))
    rows[np.arange(13), first], rows[np.arange(13), second] = -1, 1
    system = np.r_[np.sqrt(weight)[:, None] * rows, np.diag(np.sqrt(pull))]
    expected = np.linalg.lstsq(system, np.r_[np.sqrt(weight) * wanted, np.zeros(count)], rcond=None)[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)
