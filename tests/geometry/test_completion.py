"""Continued planes: found where light looks for them, never seen by the camera. Creases."""

import numpy as np
import pytest
from geometry_scenes import box_depth, look, plane_depth, room, trace

from materialist.errors import InputError
from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.build import build_geometry, split_creases
from materialist.types import Camera

CAMERA = Camera(64, 48, 60.0)


@pytest.fixture(scope="module")
def furnished():
    """The room, built with its planes: geometry, and which label is floor, wall."""
    depth, normal, label = room(CAMERA)
    geometry = build_geometry(depth, normal, CAMERA, completion="planes")
    floor, wall = (np.bincount(geometry.plane_label[(label == k)] + 1).argmax() - 1 for k in (0, 1))
    assert floor >= 0 and wall >= 0 and floor != wall
    return geometry, depth, label, floor, wall


def hit(mesh, origin, direction):
    """Distance and face_plane of one ray's first hit."""
    distance, face = trace(mesh, np.asarray(origin, float), np.array([direction], float))
    return distance[0], (mesh.face_plane[face[0]] if face[0] >= 0 else None), face[0]


def test_rays_down_beside_below_and_behind_the_camera_find_the_floor(furnished):
    geometry, _, _, floor, _ = furnished
    for x, z in ((3.5, -3.0), (-4.0, -5.0), (0.2, -0.5), (0.0, 0.0), (1.0, 2.0)):
        distance, plane, face = hit(geometry.mesh, (x, 0.3, z), (0, -1, 0))
        assert plane == floor and distance == pytest.approx(1.3, abs=0.03)
        assert geometry.plane_label.ravel()[geometry.mesh.face_pixel[face]] == floor
        np.testing.assert_allclose(
            geometry.mesh.normals[geometry.mesh.faces[face]], [[0, 1, 0]] * 3, atol=0.02
        )


def test_the_floor_and_the_wall_go_on_behind_the_box(furnished):
    geometry, _, _, floor, wall = furnished
    # Just behind the box (its back is at z = -4), where the camera sees neither.
    distance, plane, _ = hit(geometry.mesh, (-0.4, -0.5, -5.0), (0, -1, 0))
    assert plane == floor and distance == pytest.approx(0.5, abs=0.02)
    distance, plane, _ = hit(geometry.mesh, (-0.5, -0.9, -5.5), (0, 0, -1))
    assert plane == wall and distance == pytest.approx(0.5, abs=0.05)
    # Above the frame it goes on, but not without end.
    right = 6 * CAMERA.width / (2 * CAMERA.focal)
    top = 6 * CAMERA.height / (2 * CAMERA.focal)
    distance, plane, _ = hit(geometry.mesh, (0.0, 1.2 * top, -3.0), (0, 0, -1))
    assert plane == wall and distance == pytest.approx(3, abs=0.05)
    assert hit(geometry.mesh, (0.0, 2 * top, -3.0), (0, 0, -1))[1] is None
    # To the sides, where far more of it is seen, it ends with the frame.
    assert hit(geometry.mesh, (1.1 * right, 1.0, -3.0), (0, 0, -1))[1] is None


def test_planes_stop_at_each_other_and_leave_light_from_above_and_behind(furnished):
    geometry, _, _, floor, wall = furnished
    corners = geometry.mesh.vertices[geometry.mesh.faces]
    cell = 0.2
    assert corners[geometry.mesh.face_plane == floor][..., 2].min() > -6 - 6 * cell
    assert corners[geometry.mesh.face_plane == wall][..., 1].min() > -1 - cell
    for direction in ((0, 1, 0), (0, 0.3, 1), (1, 0.3, 0.2), (-1, 0.5, 0.5)):
        assert hit(geometry.mesh, (0.5, 0, 0), direction)[1] is None


def test_the_camera_sees_none_of_it(furnished):
    geometry, depth, _, _, _ = furnished
    assert (geometry.mesh.face_plane >= 0).sum() > 500
    _, face = look(
        geometry.mesh, CAMERA, np.random.default_rng(0).uniform(0.01, 0.99, (depth.size, 2))
    )
    np.testing.assert_array_equal(geometry.mesh.face_pixel[face], np.arange(depth.size))
    assert (geometry.mesh.face_plane[face] == -1).all()


def test_outdoors_the_sky_stays_open_and_the_ground_goes_far():
    ground = plane_depth(CAMERA, (0, 1, 0), -1.5)
    box, box_normal = box_depth(CAMERA, (-1, -1.5, -6), (1, 1.5, -5))
    depth = np.minimum(ground, box)
    normal = np.where((box <= ground)[..., None], box_normal, [0, 1, 0])
    depth = np.where(depth < 100, depth, 0)
    geometry = build_geometry(depth, normal, CAMERA)
    _, face = look(geometry.mesh, CAMERA, (0.43, 0.58))
    np.testing.assert_array_equal(face >= 0, depth.ravel() > 0)
    assert (geometry.mesh.face_plane[face[face >= 0]] == -1).all()
    distance, plane, _ = hit(geometry.mesh, (40, 5, -20), (0, -1, 0))
    assert plane is not None and plane >= 0 and distance == pytest.approx(6.5, rel=0.02)


def test_completion_can_be_switched_off_without_a_change_to_the_rest(furnished):
    geometry, depth, _, _, _ = furnished
    normal = room(CAMERA)[1]
    bare = build_geometry(depth, normal, CAMERA, completion="none")
    assert (bare.plane_label == -1).all() and (bare.mesh.face_plane == -1).all()
    assert bare.plane_label.dtype == np.int8 and bare.mesh.face_plane.dtype == np.int16
    count = len(bare.mesh.faces)
    np.testing.assert_array_equal(
        *(g.mesh.vertices[g.mesh.faces[:count]] for g in (geometry, bare))
    )
    np.testing.assert_array_equal(geometry.mesh.face_pixel[:count], bare.mesh.face_pixel)
    with pytest.raises(InputError, match="'walls'"):
        build_geometry(depth, normal, CAMERA, completion="walls")


def test_walls_can_end_at_the_frame(furnished):
    geometry, depth, _, floor, wall = furnished
    _, normal, _ = room(CAMERA)
    bare = build_geometry(depth, normal, CAMERA, completion="floors")

    def faces(built, plane):
        return int((built.mesh.face_plane == plane).sum())

    assert faces(bare, floor) == faces(geometry, floor)
    assert 0 < faces(bare, wall) < faces(geometry, wall)  # it still goes on behind the box
    np.testing.assert_array_equal(bare.plane_label, geometry.plane_label)


def test_the_last_row_of_a_wall_has_the_walls_normal():
    """Normals are not shared across creases, points are."""
    floor = plane_depth(CAMERA, (0, 1, 0), -1.0)
    wall = plane_depth(CAMERA, (0, 0, 1), -4.0)
    is_wall = wall < np.where(floor > 0, floor, np.inf)
    depth = np.where(is_wall, wall, floor)
    normal = np.where(is_wall[..., None], [0.0, 0, 1], [0.0, 1, 0]).astype(np.float32)
    mesh = depth_to_mesh(depth, normal, CAMERA)
    blended = np.abs(mesh.normals).max(-1) < 0.9
    assert blended.sum() > 40  # the mean of wall and floor
    split = split_creases(mesh, depth, normal)
    np.testing.assert_array_equal(
        build_geometry(depth, normal, CAMERA, completion="none").mesh.normals, split.normals
    )
    own = normal.reshape(-1, 3)[split.face_pixel]  # [F, 3]
    np.testing.assert_allclose(split.normals[split.faces], np.repeat(own[:, None], 3, 1), atol=1e-6)
