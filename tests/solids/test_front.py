"""The smooth front of an object, against a ball of known depth."""

import numpy as np
from geometry_scenes import ball

from materialist.camera import pixel_rays
from materialist.solids.front import smooth_front
from materialist.types import Camera

CAMERA = Camera(64, 64, 30.0)
RAYS = pixel_rays(CAMERA)
DEPTH, NORMAL, SEEN, THICK = ball(CAMERA, (0, 0, -3), 0.5)
DEPTH[~SEEN] = 3.0
INSIDE = THICK > 0.64


def test_an_edge_stays_where_it_is():
    """A roof: neither side is moved by the mean of the two slopes at its ridge."""
    roof = [np.array([0.6, 0, 0.8]), np.array([-0.8, 0, 0.6])]
    left, right = (float(n @ [0, 0, -3]) / (RAYS @ n) for n in roof)
    depth = np.maximum(left, right)
    normal = np.where((left > right)[..., None], roof[0], roof[1])
    front = smooth_front(depth, normal, np.ones(depth.shape, bool), RAYS, smooth=0.0)
    assert np.abs(front / depth - 1)[4:-4, 4:-4].max() < 2e-4


def test_normals_take_away_the_noise_of_the_depth():
    depth, normal, inside = DEPTH, NORMAL, INSIDE
    noisy = depth * np.exp(np.random.default_rng(0).normal(0, 0.005, depth.shape))
    front = smooth_front(noisy, normal, inside, RAYS, smooth=0.0)
    error = lambda z: np.sqrt(np.mean(np.log(z / depth)[inside] ** 2))  # noqa: E731
    assert error(front) < 0.15 * error(noisy)
