"""Slopes of log depth from normals, against the depth of a plane."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.slopes import slopes
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
