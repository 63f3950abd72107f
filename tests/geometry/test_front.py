"""The smooth front of an object, against a ball of known depth."""

from dataclasses import replace

import numpy as np

from materialist.bench.glass_scenes import seen
from materialist.camera import pixel_rays
from materialist.procedural.objects import shapes
from materialist.solids.front import of_one_surface, smooth_front
from materialist.types import Camera

ANGLE = np.linspace(-np.pi, np.pi, 120)
RAYS = pixel_rays(Camera(96, 96, 30.0))


def _ball() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Planar depth [96, 96], unit normals and mask of a ball of radius 0.5 at depth 3."""
    centre = np.array([0, 0, -3.0])
    along, squared = RAYS @ centre, (RAYS**2).sum(-1)
    rest = along**2 - squared * (centre @ centre - 0.25)
    depth = (along - np.sqrt(np.maximum(rest, 0))) / squared
    return depth, (RAYS * depth[..., None] - centre) / 0.5, rest > 0.1  # 0.25 in the middle, 0 at the outline


def test_exact_depth_and_normals_stay():
    depth, normal, inside = _ball()
    front = smooth_front(depth, normal, inside, RAYS, smooth=0.0)
    assert np.abs(front / depth - 1)[inside].max() < 2e-4  # the ball is a sixth as deep as it is far
    np.testing.assert_array_equal(front[~inside], depth[~inside])


def test_an_edge_stays_where_it_is():
    """A roof: neither side is moved by the mean of the two slopes at its ridge."""
    roof = [np.array([0.6, 0, 0.8]), np.array([-0.8, 0, 0.6])]
    left, right = (float(n @ [0, 0, -3]) / (RAYS @ n) for n in roof)
    depth = np.maximum(left, right)
    normal = np.where((left > right)[..., None], roof[0], roof[1])
    front = smooth_front(depth, normal, np.ones(depth.shape, bool), RAYS, smooth=0.0)
    assert np.abs(front / depth - 1)[4:-4, 4:-4].max() < 1e-4


def test_normals_take_away_the_noise_of_the_depth():
    depth, normal, inside = _ball()
    noisy = depth * np.exp(np.random.default_rng(0).normal(0, 0.005, depth.shape))
    front = smooth_front(noisy, normal, inside, RAYS, smooth=0.0)
    error = lambda z: np.sqrt(np.mean(np.log(z / depth)[inside] ** 2))  # noqa: E731
    assert error(front) < 0.1 * error(noisy)


def test_a_part_that_hides_another_stays_in_front_of_it():
    depth = np.full((96, 96), 3.0)
    depth[:, 48:] = 4.0
    front = smooth_front(depth, -RAYS / np.linalg.norm(RAYS, axis=-1, keepdims=True), np.ones((96, 96), bool), RAYS)
    steps = np.diff(np.log(front[48]))
    assert np.argmax(steps) == 47 and steps[47] > 0.8 * np.log(4 / 3)


def test_exact_maps_of_what_hides_a_part_of_itself_stay():
    """A ring: behind the near part its far one goes on, and its top is seen at a grazing angle."""
    ring = shapes.lathe(np.stack([0.3 + 0.12 * np.cos(ANGLE), 0.12 * np.sin(ANGLE)], -1), 256)
    tilt = np.array([[1, 0, 0], [0, np.cos(0.25), -np.sin(0.25)], [0, np.sin(0.25), np.cos(0.25)]])
    ring = replace(ring, vertices=ring.vertices @ tilt.T + [0, 0, -2.2], normals=ring.normals @ tilt.T)
    found = seen(ring, Camera(96, 96, 30.0))
    inside = found.depth > 0
    assert of_one_surface(found.depth, found.normal, inside, RAYS)
    off = smooth_front(found.depth, found.normal, inside, RAYS)[inside] - found.depth[inside]
    assert np.sqrt(np.mean(off**2)) < 0.006 and (np.abs(off) > 0.002).mean() < 0.06  # the ring is 0.84 wide
    noisy = found.depth * np.exp(np.random.default_rng(0).normal(0, 2e-3, inside.shape))
    assert not of_one_surface(noisy, found.normal, inside, RAYS)


def test_a_few_pixels_are_left_alone():
    depth, normal, _ = _ball()
    inside = np.zeros((96, 96), bool)
    inside[40:42, 40:44] = True
    np.testing.assert_array_equal(smooth_front(depth, normal, inside, RAYS), depth)
