"""Slopes of normals and of depth: exact on planes, up to where they end, and near the truth on a ball."""

import numpy as np
from geometry_scenes import ball
from scipy.ndimage import binary_erosion

from materialist.camera import pixel_rays
from materialist.geometry.slopes import (
    back_normals,
    blurred_normals,
    continued,
    depth_slopes,
    least_squares_change,
    slopes,
)
from materialist.types import Camera

CAMERA = Camera(64, 48, 40.0)
RAYS = pixel_rays(CAMERA).astype(float)
ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)
DISC = np.hypot(ROWS - 24, COLUMNS - 32) < 15
PLANE = 3 + 0.2 * COLUMNS - 0.05 * ROWS


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


def test_a_map_is_read_and_carried_on_along_its_plane():
    known = np.where(DISC, PLANE, 99)
    for sigma in (0.5, 2.0):
        right, down = depth_slopes(known, DISC, sigma)
        np.testing.assert_allclose(right[DISC], 0.2, atol=1e-4)
        np.testing.assert_allclose(down[DISC], -0.05, atol=1e-4)
    near = np.hypot(ROWS - 24, COLUMNS - 32) < 16
    np.testing.assert_allclose(continued(known, DISC)[near], PLANE[near], atol=1e-3)
    alone = np.zeros((48, 64), bool)
    alone[10, 10] = True
    assert (continued(ROWS, alone) == 10).all()


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


def test_the_back_of_a_ball_and_its_blurred_normals():
    front, _, inside, thick = ball(CAMERA, (0, 0, -3), 0.6)
    depth = front + thick / np.linalg.norm(RAYS, axis=-1)
    true = (RAYS * depth[..., None] - [0, 0, -3]) / 0.6
    cosine = (back_normals(depth, inside, RAYS) * true).sum(-1)[inside]
    assert np.median(cosine) > 0.9999 and np.quantile(cosine, 0.1) > 0.99
    assert np.quantile((blurred_normals(true, inside, 1.0) * true).sum(-1)[inside], 0.1) > 0.99
    np.testing.assert_allclose(blurred_normals(true, inside, 0.0)[inside], true[inside], atol=1e-12)
