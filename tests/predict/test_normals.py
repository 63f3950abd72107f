"""Normals from depth against planes and a sphere."""

import numpy as np
import pytest
from geometry_scenes import ball, plane_depth

from materialist.predict.normals import normals_from_depth
from materialist.types import Camera

CAMERA = Camera(72, 48, 50.0)


def angle(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """[...] degrees between unit vectors."""
    return np.degrees(2 * np.arcsin(np.clip(np.linalg.norm(a - b, axis=-1) / 2, 0, 1)))


@pytest.mark.parametrize("normal", [(0, 0, 1), (0.6, 0, 0.8), (0, 0.9, 0.436), (-0.3, -0.5, 0.81)])
@pytest.mark.parametrize("radius", [0, 2])
def test_a_plane_is_exact_up_to_the_border(normal, radius):
    n = np.asarray(normal, float) / np.linalg.norm(normal)
    depth = plane_depth(CAMERA, n, -3.0)
    assert (depth > 0).all()
    assert angle(normals_from_depth(depth, CAMERA, radius=radius), n).max() < 0.01


def test_two_planes_keep_their_normals_at_the_edge_between_them():
    wall, floor = np.array([0, 0, 1.0]), np.array([0, 1.0, 0])
    d_wall, d_floor = plane_depth(CAMERA, wall, -4.0), plane_depth(CAMERA, floor, -1.0)
    on_floor = (d_floor > 0) & (d_floor < d_wall)
    normal = normals_from_depth(np.where(on_floor, d_floor, d_wall), CAMERA)
    assert np.percentile(angle(normal[on_floor], floor), 99) < 0.1
    assert np.percentile(angle(normal[~on_floor], wall), 99) < 0.1


def test_a_sphere_is_close_to_its_normals():
    depth, truth, mask, _ = ball(CAMERA, (0, 0, -4), 1.0)
    error = angle(normals_from_depth(depth, CAMERA), truth)[mask & (truth[..., 2] > 0.5)]
    assert error.mean() < 1.0 and error.max() < 6.0


def test_holes_face_the_viewer_and_do_not_spread():
    depth = plane_depth(CAMERA, np.array([0.6, 0, 0.8]), -3.0)
    depth[:, 40:] = 0
    depth[5, 5] = 0
    normal = normals_from_depth(depth, CAMERA)
    assert np.isfinite(normal).all()
    assert np.array_equal(normal[5, 5], [0, 0, 1]) and np.array_equal(normal[20, 60], [0, 0, 1])
    assert angle(normal[depth > 0], np.array([0.6, 0, 0.8])).max() < 0.01
