"""Creases: normals are not shared across them, points are."""

import numpy as np
from geometry_scenes import plane_depth

from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.build import build_geometry, split_creases
from materialist.types import Camera

CAMERA = Camera(48, 36, 50.0)


def _corner():
    """A floor before a wall: depth [H, W], normals [H, W, 3], and where the wall is [H, W] bool."""
    floor, wall = plane_depth(CAMERA, (0, 1, 0), -1.0), plane_depth(CAMERA, (0, 0, 1), -4.0)
    is_wall = wall < np.where(floor > 0, floor, np.inf)
    depth = np.where(is_wall, wall, floor)
    return depth, np.where(is_wall[..., None], [0.0, 0, 1], [0.0, 1, 0]).astype(np.float32), is_wall


def test_the_last_row_of_a_wall_has_the_walls_normal():
    depth, normal, _ = _corner()
    mesh = depth_to_mesh(depth, normal, CAMERA)
    blended = np.abs(mesh.normals).max(-1) < 0.9
    assert blended.sum() > 40  # the mean of wall and floor
    split = split_creases(mesh, depth, normal)
    np.testing.assert_array_equal(build_geometry(depth, normal, CAMERA, completion="none").mesh.normals, split.normals)
    own = normal.reshape(-1, 3)[split.face_pixel]  # [F, 3]
    np.testing.assert_allclose(split.normals[split.faces], np.repeat(own[:, None], 3, 1), atol=1e-6)
