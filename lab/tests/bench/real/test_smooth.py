"""Normals of a measured depth: exact on planes, unknown where there is none."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.types import Camera
from materialist_lab.bench.real.smooth import plane_normals

CAMERA = Camera(160, 120, 60.0)


def _plane(normal, distance=3.0):
    """[H, W] depth of the plane with that normal, `distance` in front of the camera."""
    normal = np.array(normal) / np.linalg.norm(normal)
    return (-distance * normal[2] / (pixel_rays(CAMERA) @ normal)).astype(np.float32)


def test_planes_have_their_own_normal():
    for normal in ([0, 0, 1], [0.3, 0, 0.9], [0, 0.6, 0.8]):
        normals = plane_normals(_plane(normal), CAMERA)
        known = normals.any(-1)
        assert known.mean() > 0.8
        np.testing.assert_allclose(
            normals[known],
            np.array(normal) / np.linalg.norm(normal) + 0 * normals[known],
            atol=1e-3,
        )


def test_noise_in_disparity_turns_them_little():
    rng = np.random.default_rng(0)
    noisy = 1 / (1 / _plane([0.3, 0, 0.9]) * (1 + 0.005 * rng.standard_normal((120, 160))))
    normals = plane_normals(noisy.astype(np.float32), CAMERA)
    known = normals.any(-1)
    cosine = normals[known] @ (np.array([0.3, 0, 0.9]) / np.linalg.norm([0.3, 0, 0.9]))
    assert known.mean() > 0.8 and np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean() < 5


def test_steps_holes_and_bends_are_unknown():
    depth = np.full((120, 160), 2.0, np.float32)
    depth[:, 80:] = 4  # a step
    depth[50:70, 20:40] = 0  # a hole
    known = plane_normals(depth, CAMERA).any(-1)
    assert not known[:, 78:82].any() and not known[50:70, 20:40].any()
    assert known[20, 20] and known[100, 140]
    rough = 2 + 0.2 * np.random.default_rng(1).random((120, 160)).astype(np.float32)
    assert plane_normals(rough, CAMERA).any(-1).mean() < 0.01
