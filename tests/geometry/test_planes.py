"""Dominant planes: found where they are, and not where they are not."""

import numpy as np
import pytest
from geometry_scenes import room, sphere_depth

from materialist.geometry.planes import find_planes
from materialist.types import Camera

CAMERA = Camera(128, 96, 60.0)


def degrees_between(a, b):
    return np.degrees(np.arccos(np.clip(np.dot(a, b), -1, 1)))


@pytest.mark.parametrize("seed", [0, 1])
def test_floor_and_wall_of_a_room(seed):
    depth, normal, label = room(CAMERA)
    planes, again = (find_planes(depth, normal, CAMERA, seed=seed) for _ in range(2))
    assert all(
        (a.normal == b.normal).all() and (a.mask == b.mask).all()
        for a, b in zip(planes, again, strict=True)
    )
    for k, (true, offset) in enumerate((((0, 1, 0), -1.0), ((0, 0, 1), -6.0))):
        best = min(
            planes,
            key=lambda plane: degrees_between(plane.normal, true) + abs(plane.offset - offset),
        )
        assert degrees_between(best.normal, true) < 1
        assert best.offset == pytest.approx(offset, rel=0.02)
        overlap = (best.mask & (label == k)).sum() / (best.mask | (label == k)).sum()
        assert overlap > 0.97


def test_noise_in_depth_and_normals_is_survived():
    rng = np.random.default_rng(3)
    depth, normal, label = room(CAMERA)
    depth = depth * (1 + 0.006 * rng.standard_normal(depth.shape))
    normal = normal + 0.1 * rng.standard_normal(normal.shape)
    normal = (normal / np.linalg.norm(normal, axis=-1, keepdims=True)).astype(np.float32)
    planes = find_planes(depth, normal, CAMERA)
    floor = min(planes, key=lambda plane: degrees_between(plane.normal, (0, 1, 0)))
    assert degrees_between(floor.normal, (0, 1, 0)) < 1
    assert (floor.mask & (label == 0)).sum() > 0.9 * (label == 0).sum()


@pytest.mark.parametrize("radius", [0.8, 1.8])
def test_a_sphere_is_no_plane(radius):
    sphere, outward = sphere_depth(CAMERA, (0, 0, -4), radius)
    depth = np.where(np.isfinite(sphere), sphere, 0)
    assert (
        find_planes(depth, np.where(depth[..., None] > 0, outward, 0).astype(np.float32), CAMERA)
        == []
    )
