"""Slopes of normals and of depth: exact on planes, up to where they end."""

import numpy as np
from scipy.ndimage import binary_erosion

from materialist.camera import pixel_rays
from materialist.geometry.slopes import (
    back_normals,
    least_squares_change,
    slopes,
)
from materialist.types import Camera

CAMERA = Camera(64, 48, 40.0)
RAYS = pixel_rays(CAMERA).astype(float)
ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)
DISC = np.hypot(ROWS - 24, COLUMNS - 32) < 15


def test_a_plane_has_the_slopes_of_its_depth():
    rays = pixel_rays(Camera(160, 120, 40.0))
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    log_depth = np.log(-2.0 / (rays @ normal))
    across, down = slopes(np.broadcast_to(normal, rays.shape), rays)
    assert np.abs((across[:, 1:] + across[:, :-1]) / 2 - np.diff(log_depth, axis=1)).max() < 1e-6
    assert np.abs((down[1:] + down[:-1]) / 2 - np.diff(log_depth, axis=0)).max() < 1e-6
    away = np.broadcast_to(np.array([1.0, 0, 0]), rays.shape)
    assert np.isfinite(slopes(away, rays)).all()  # grazing


def test_the_change_solves_the_dense_least_squares_problem():
    rng = np.random.default_rng(0)
    count, first, second = 12, np.r_[np.arange(11), 0, 3], np.r_[np.arange(1, 12), 7, 11]
    wanted, weight, pull = rng.normal(size=13), rng.uniform(0.01, 2, 13), rng.uniform(0.1, 1, count)
    found = least_squares_change(first, second, wanted, weight, pull, rtol=1e-12, maxiter=200)
    rows = np.zeros((13, count))
    rows[np.arange(13), first], rows[np.arange(13), second] = -1, 1
    system = np.r_[np.sqrt(weight)[:, None] * rows, np.diag(np.sqrt(pull))]
    expected = np.linalg.lstsq(system, np.r_[np.sqrt(weight) * wanted, np.zeros(count)], rcond=None)[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_flat_slanting_back_has_one_normal_even_next_to_an_edge():
    """Two planes that meet in a column: right on either side of it, in perspective."""
    normals = [np.array([0.3, -0.4, -np.sqrt(0.75)]), np.array([-0.5, 0.1, -np.sqrt(0.74)])]
    left, right = (float(n @ [0, 0, -3]) / (RAYS @ n) for n in normals)
    first = left < right
    found = back_normals(np.minimum(left, right), DISC, RAYS)
    for own, normal in ((first, normals[0]), (~first, normals[1])):
        inner = binary_erosion(own, np.ones((5, 5))) & DISC
        assert inner.sum() > 100 and ((found[inner] @ normal) > 1 - 1e-6).all()
    assert (found[~DISC] == 0).all()
