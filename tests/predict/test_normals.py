"""Normals from depth against planes and a sphere, and the shift of relative depths that normals reveal."""

import numpy as np
import pytest
from geometry_scenes import ball, plane_depth

from materialist.predict.normals import normals_from_depth
from materialist.predict.relative import SETTINGS, from_relative
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
    wall = np.array([0, 0, 1.0])
    floor = np.array([0, 1.0, 0])
    d_wall = plane_depth(CAMERA, wall, -4.0)
    d_floor = plane_depth(CAMERA, floor, -1.0)
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


VIEW = Camera(96, 72, 50.0)
KINDS = [(True, lambda z: 3 / z + 0.7), (False, lambda z: 0.1 * z - 4)]
"""Whether the values are inverse depths, and values of a true depth."""


def room() -> np.ndarray:
    """[72, 96] depth of a floor that meets a wall, with a box on it."""
    inverse = np.maximum((np.arange(72)[:, None] + 0.5 - 20) / 52, 0.22) * np.ones((1, 96))
    inverse[30:60, 20:45] = np.maximum(inverse[30:60, 20:45], 0.75 + 0.004 * np.arange(25))
    return (1 / inverse).astype(np.float32)


@pytest.mark.parametrize(("inverse", "relative"), KINDS)
def test_normals_reveal_the_shift(inverse, relative):
    true = room()
    values = relative(true).astype(np.float32)
    normal = normals_from_depth(true, VIEW)
    depth, ratio, fitted = from_relative(values, VIEW, normal, inverse=inverse)
    assert fitted and ratio == pytest.approx(
        np.percentile(true, 99.5) / np.percentile(true, 0.5), rel=0.12
    )
    assert np.std(np.log(depth / true)) < 0.05


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_wall_that_faces_the_camera_may_be_most_of_the_picture(share):
    """Its normals are right at any ratio; the floor before it tells, however little of it is seen."""
    rows = np.arange(72)[:, None] + 0.5
    horizon = 0.15 * 72
    foot = share * 72
    inverse = np.maximum(rows - horizon, foot - horizon) * np.ones((1, 96))
    true = (60 / inverse).astype(np.float32)
    ratio = from_relative(
        (1 / true).astype(np.float32), VIEW, normals_from_depth(true, VIEW), inverse=True
    )[1]
    assert ratio == pytest.approx(np.percentile(true, 99.5) / np.percentile(true, 0.5), rel=0.12)


@pytest.mark.parametrize(("inverse", "relative"), KINDS)
def test_without_normals_the_ratio_is_the_documented_one(inverse, relative):
    for normal in (None, np.zeros((72, 96, 3), np.float32)):
        depth, ratio, fitted = from_relative(relative(room()), VIEW, normal, inverse=inverse)
        assert ratio == SETTINGS.ratio and not fitted and depth.dtype == np.float32
        near, far = np.percentile(depth, (0.5, 99.5))
        assert (near, far) == (pytest.approx(1, rel=1e-3), pytest.approx(SETTINGS.ratio, rel=1e-3))
        assert (np.diff(depth[40:, 5]) <= 0).all()  # the floor comes nearer downwards
