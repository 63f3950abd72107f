"""The side view of a mesh: nearer surfaces hide farther ones, large faces have no holes."""

import numpy as np

from materialist.io.relief import relief
from materialist.types import Camera, Mesh

CAMERA = Camera(60, 40, 40.0)


def quad(depth, half, plane):
    """Corners and plane numbers of a square facing the camera at `depth`."""
    corners = np.array([[-half, half, -depth], [-half, -half, -depth], [half, -half, -depth], [half, half, -depth]])
    return corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.full(2, plane, np.int16)


def mesh_of(*quads):
    vertices = np.concatenate([q[0] for q in quads])
    faces = np.concatenate([q[1] + 4 * i for i, q in enumerate(quads)])
    normals = np.tile(np.float32([0, 0, 1]), (len(vertices), 1))
    plane = np.concatenate([q[2] for q in quads])
    return Mesh(vertices, faces, normals, vertices[:, :2], np.zeros(len(faces), np.int32), plane)


def is_blue(picture):
    return picture[..., 2] > picture[..., 0] + 10


def test_a_near_object_hides_the_wall_behind_it_without_holes():
    picture = relief(mesh_of(quad(3.0, 0.4, -1), quad(6.0, 6.5, 0)), CAMERA, side=120)
    assert picture.shape == (80, 120, 3)
    assert not is_blue(picture[38:42, 58:62]).any()  # the object, about which the camera turns
    assert is_blue(picture[[0, 0, -1, -1], [0, -1, 0, -1]]).all()
    clay = picture[..., 0] > 120
    rows, columns = np.nonzero(clay)
    box = clay[rows.min() : rows.max() + 1, columns.min() : columns.max() + 1]
    assert box.mean() > 0.6  # a convex quadrilateral fills its box; a sieve would not
    assert (picture == (36, 38, 42)).all(-1).mean() < 1e-3  # the wall reaches over the whole picture, evenly sampled
    assert (relief(mesh_of(quad(3.0, 0.4, -1), quad(6.0, 6.5, 0)), CAMERA, side=120) == picture).all()


def test_the_order_of_faces_does_not_matter():
    near, far = quad(3.0, 0.4, -1), quad(6.0, 6.5, 0)
    one, two = relief(mesh_of(near, far), CAMERA, side=60), relief(mesh_of(far, near), CAMERA, side=60)
    assert np.mean(is_blue(one) != is_blue(two)) < 0.02


def test_faces_behind_the_camera_are_left_out():
    behind = quad(-4.0, 1.0, 0)
    lone = relief(mesh_of(quad(3.0, 0.4, -1)), CAMERA)
    assert (relief(mesh_of(quad(3.0, 0.4, -1), behind), CAMERA) == lone).all()
