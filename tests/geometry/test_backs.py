"""Backs of objects: true shadows, closed, and never seen by the camera."""

import dataclasses

import numpy as np
import pytest
from geometry_scenes import box_depth, plane_depth, screen_rays, sphere_depth, trace

from materialist.geometry.boundary import depth_to_mesh
from materialist.geometry.build import build_geometry, completion_of
from materialist.geometry.inflate import inflated
from materialist.geometry.objects import find_objects
from materialist.io.ply import read_ply, write_ply
from materialist.types import Camera

CAMERA = Camera(80, 64, 40.0)
CENTRE, RADIUS = np.array([-0.25, -0.4, -4.0]), 0.6
FLOOR, BALL, BOX = 0, 2, 3


def maps(camera=CAMERA, with_box=False):
    """Floor y = -1, wall z = -8, a ball on the floor, perhaps a box that it hides in part: depth, normal, label."""
    floor, wall = plane_depth(camera, (0, 1, 0), -1.0), plane_depth(camera, (0, 0, 1), -8.0)
    ball, ball_normal = sphere_depth(camera, CENTRE, RADIUS)
    box, box_normal = box_depth(camera, (0.1, -1, -5.6), (1.0, 0.2, -5.0))
    depths = np.stack([floor, wall, ball, box if with_box else np.full_like(box, np.inf)])
    label = depths.argmin(0)
    normal = np.array([[0.0, 1, 0], [0, 0, 1], [0, 0, 0], [0, 0, 0]])[label]
    normal[label == BALL], normal[label == BOX] = ball_normal[label == BALL], box_normal[label == BOX]
    return depths.min(0), normal.astype(np.float32), label


@pytest.fixture(scope="module")
def ball():
    """The ball's maps, and its geometry with and without backs."""
    depth, normal, label = maps()
    built = {c: build_geometry(depth, normal, CAMERA, completion=c) for c in ("planes", "planes,backs")}
    return depth, normal, label, built["planes"], built["planes,backs"]


def faces_of(mesh, label, thing, *, first=None):
    """The mesh with the depth surface's and the backs' faces of one thing alone."""
    mine = (label.ravel()[mesh.face_pixel] == thing) & (mesh.face_plane < 0)
    return dataclasses.replace(mesh, faces=mesh.faces[mine], face_pixel=mesh.face_pixel[mine])


def shadow_area(mesh, to_sun):
    """Area on the floor that the mesh keeps from a far sun, by rays from it through a square across about the ball."""
    across = np.cross(to_sun, [0.3, 0.2, 0.9])
    across /= np.linalg.norm(across)
    step = (np.arange(40) - 19.5) * 0.04
    points = CENTRE + (step[:, None, None] * across + step[:, None] * np.cross(to_sun, across)).reshape(-1, 3)
    sun = CENTRE + 2000 * to_sun
    distance, _ = trace(mesh, sun, points - sun)
    return np.isfinite(distance).sum() * 0.04**2 / to_sun[1]


@pytest.mark.parametrize("azimuth", [90, -90, 180])
def test_a_ball_casts_its_shadow_under_a_sun_from_the_side(ball, azimuth):
    _, _, label, open_geometry, geometry = ball
    a = np.radians(azimuth)
    to_sun = np.array([np.sin(a), 1.0, np.cos(a)]) / np.sqrt(2)  # 45 degrees high
    true = np.pi * RADIUS**2 * np.sqrt(2)
    closed = shadow_area(faces_of(geometry.mesh, label, BALL), to_sun)
    before = shadow_area(faces_of(open_geometry.mesh, label, BALL), to_sun)
    assert closed == pytest.approx(true, rel=0.12)
    assert before < closed
    if abs(azimuth) == 90:
        assert before < 0.75 * true


def test_the_camera_sees_the_same_surface():
    depth, normal, _ = maps(with_box=True)
    before = build_geometry(depth, normal, CAMERA, completion="planes").mesh
    mesh = build_geometry(depth, normal, CAMERA, completion="planes,backs").mesh
    assert len(mesh.faces) > len(before.faces) + 500
    pixels = np.random.default_rng(0).choice(depth.size, 250, replace=False)
    at = np.stack([pixels % CAMERA.width, pixels // CAMERA.width], -1)
    rays = screen_rays(CAMERA, at + np.random.default_rng(1).uniform(0.01, 0.99, (len(pixels), 2)))
    distance, face = trace(mesh, np.zeros(3), rays)
    old, _ = trace(before, np.zeros(3), rays)
    assert (face < 2 * np.count_nonzero(depth)).all()  # the depth map's own faces
    np.testing.assert_array_equal(mesh.face_pixel[face], pixels)
    same = np.abs(distance - old) < 1e-6
    assert same.mean() > 0.95 and (distance > old - 1e-6).all()  # rims alone move, and away


@pytest.mark.parametrize("seed", range(4))
def test_random_boards_and_holes(seed):
    """Boards before a wall, in any order, over the frame's sides, some with holes to the sky."""
    camera, rng = Camera(30, 22, 45.0), np.random.default_rng(seed)
    depth = np.full((22, 30), 9.0)
    for _ in range(6):
        row, column = rng.integers(-3, 18), rng.integers(-3, 26)
        board = np.s_[max(row, 0) : row + rng.integers(4, 9), max(column, 0) : column + rng.integers(4, 12)]
        depth[board] = np.minimum(depth[board], rng.uniform(2, 8))
    depth[rng.uniform(size=depth.shape) < 0.02] = 0
    normal = np.tile(np.float32([0, 0, 1]), (22, 30, 1))
    plain, mesh = (build_geometry(depth, normal, camera, completion=c).mesh for c in ("planes", "planes,backs"))
    assert (len(mesh.faces) > len(plain.faces)) == (seed > 0)  # what stands free with seed 0 is two pixels wide
    pixels = np.arange(depth.size)
    at = np.stack([pixels % 30, pixels // 30], -1) + rng.uniform(0.01, 0.99, (depth.size, 2))
    distance, face = trace(mesh, np.zeros(3), screen_rays(camera, at))
    np.testing.assert_array_equal(face >= 0, depth.ravel() > 0)
    np.testing.assert_array_equal(mesh.face_pixel[face[face >= 0]], pixels[face >= 0])
    before, _ = trace(plain, np.zeros(3), screen_rays(camera, at))
    np.testing.assert_allclose(distance[face >= 0], before[face >= 0], rtol=0.03)  # rims move a little


def loose_edges(mesh, label, thing, plain):
    """How many edges of a thing's added faces no other of its faces runs through backwards, and how many there are.

    Vertices at one place are one. `plain` is the number of faces before backs were added.
    """
    part = faces_of(mesh, label, thing)
    added = np.flatnonzero((label.ravel()[mesh.face_pixel] == thing) & (mesh.face_plane < 0)) >= plain
    place = np.unique(part.vertices, axis=0, return_inverse=True)[1].reshape(-1).astype(np.int64)
    faces = place[part.faces]
    ends = np.stack([faces, np.roll(faces, -1, 1)], -1)  # [F, 3, 2]
    edges, count = np.unique(ends[added].reshape(-1, 2), axis=0, return_counts=True)
    backwards, of_all = np.unique(ends.reshape(-1, 2)[:, ::-1], axis=0, return_counts=True)
    known = {tuple(edge): n for edge, n in zip(backwards.tolist(), of_all.tolist())}
    return sum(known.get(tuple(e), 0) < n for e, n in zip(edges.tolist(), count.tolist())), len(edges)


def winding(mesh, point):
    """How often the mesh's faces wind around a point: 1 inside a closed surface, 0 outside."""
    a, b, c = (mesh.vertices[mesh.faces[:, k]].astype(float) - point for k in range(3))
    la, lb, lc = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    volume = (a * np.cross(b, c)).sum(-1)
    rest = la * lb * lc + (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return 2 * np.arctan2(volume, rest).sum() / (4 * np.pi)


@pytest.mark.parametrize("thing", [BALL, BOX])
def test_objects_are_closed(thing):
    depth, normal, label = maps(with_box=True)
    plain = build_geometry(depth, normal, CAMERA).mesh
    mesh = build_geometry(depth, normal, CAMERA, completion="planes,backs").mesh
    loose, edges = loose_edges(mesh, label, thing, len(plain.faces))
    assert loose == 0 and edges > 500
    inside, outside = (CENTRE, CENTRE * 1.25) if thing == BALL else ([0.7, -0.4, -5.15], [0.7, 0.5, -5.1])
    assert winding(faces_of(mesh, label, thing), np.array(inside)) == pytest.approx(1, abs=0.05)
    assert winding(faces_of(mesh, label, thing), np.array(outside)) == pytest.approx(0, abs=0.05)
    assert winding(faces_of(plain, label, thing), np.array(inside)) < 0.8


def test_no_light_comes_up_through_a_ball(ball):
    _, _, label, open_geometry, geometry = ball
    rng = np.random.default_rng(0)
    angle, distance = rng.uniform(0, 2 * np.pi, 400), 0.85 * RADIUS * np.sqrt(rng.uniform(0, 1, 400))
    points = CENTRE + np.stack([distance * np.cos(angle), np.zeros(400), distance * np.sin(angle)], -1)
    below = CENTRE - [0, 3000, 0]
    for mesh, all_hit in ((geometry.mesh, True), (open_geometry.mesh, False)):
        reached, _ = trace(faces_of(mesh, label, BALL), below, points - below)
        assert np.isfinite(reached).all() == all_hit


def test_backs_stay_before_floor_and_wall_and_behind_the_front(ball):
    _, _, label, open_geometry, geometry = ball
    mesh = geometry.mesh
    added = np.arange(len(open_geometry.mesh.faces), len(mesh.faces))
    corners = mesh.vertices[mesh.faces[added]].astype(float)
    assert corners[..., 1].min() > -1.001 and corners[..., 2].min() > -8
    assert (label.ravel()[mesh.face_pixel[added]] == BALL).all() and (mesh.face_plane[added] == -1).all()
    uv = mesh.uv[mesh.faces[added]]
    screen = corners[..., :2] / -corners[..., 2:] * [1, -1] * CAMERA.focal + [CAMERA.width / 2, CAMERA.height / 2]
    assert np.abs(uv * [CAMERA.width, CAMERA.height] - screen).max() < 0.8
    assert np.isfinite(mesh.normals).all() and np.allclose(np.linalg.norm(mesh.normals, axis=-1), 1, atol=1e-5)
    # The back of the ball reaches about as far as the ball's.
    assert -corners[..., 2].min() == pytest.approx(-CENTRE[2] + RADIUS, rel=0.04)


def test_large_backs_have_few_triangles():
    camera = Camera(256, 192, 40.0)
    depth, normal, label = maps(camera)
    plain = build_geometry(depth, normal, camera, completion="planes").mesh
    mesh = build_geometry(depth, normal, camera, completion="planes,backs").mesh
    assert 0 < len(mesh.faces) - len(plain.faces) < 0.8 * (label == BALL).sum()  # two a pixel without blocks
    assert loose_edges(mesh, label, BALL, len(plain.faces))[0] == 0


def test_the_same_maps_give_the_same_mesh_and_a_package_keeps_it(ball, tmp_path):
    depth, normal, _, open_geometry, geometry = ball
    again = build_geometry(depth, normal, CAMERA, completion="planes,backs").mesh
    write_ply(tmp_path / "mesh.ply", geometry.mesh)
    read = read_ply(tmp_path / "mesh.ply")
    for field in dataclasses.fields(again):
        for other in (again, read):
            value, expected = getattr(other, field.name), getattr(geometry.mesh, field.name)
            assert value.dtype == expected.dtype
            np.testing.assert_array_equal(value, expected)
    bare = build_geometry(depth, normal, CAMERA, completion="none")
    names = [completion_of(g) for g in (geometry, open_geometry, bare)]
    assert names == ["planes,backs", "planes", "none"]


def test_what_is_behind_its_surroundings_is_no_object():
    # A bumpy hill fills the view beyond a window's frame; the frame is a plane that stands before it.
    camera = Camera(64, 48, 50.0)
    rng = np.random.default_rng(0)
    depth = np.full((48, 64), 3.0)
    depth[12:36, 16:48] = 9 + np.repeat(np.repeat(rng.uniform(-0.5, 0.5, (6, 8)), 4, 0), 4, 1)
    normal = np.tile(np.float32([0, 0, 1]), (48, 64, 1))
    mesh = depth_to_mesh(depth, normal, camera)
    taken = depth == 3
    assert (find_objects(mesh, depth, normal, taken).label == -1).all()
    before = np.where(taken, 9.0, 3.0)  # the other way round it stands before them
    found = find_objects(depth_to_mesh(before, normal, camera), before, normal, taken)
    np.testing.assert_array_equal(found.label, np.where(taken, -1, 0))
    assert found.free.all() and len(found.border) == 2 * (24 + 32)


def test_a_surface_whose_normals_contradict_it_stays_open():
    depth, normal, label = maps()
    normal[label == BALL] = [0, 0, 1]
    plain = build_geometry(depth, normal, CAMERA, completion="planes").mesh
    closed = build_geometry(depth, normal, CAMERA, completion="planes,backs").mesh
    np.testing.assert_array_equal(closed.faces, plain.faces)
    np.testing.assert_array_equal(closed.vertices, plain.vertices)


def test_sections_are_taken_to_be_round():
    camera = Camera(128, 128, 12.0)  # nearly parallel rays
    depth, normal = sphere_depth(camera, (0, 0, -20), 1.5)
    inside = np.isfinite(depth)
    depth = np.where(inside, depth, 0)
    mesh = depth_to_mesh(depth, np.where(inside[..., None], normal, [0, 0, 1]).astype(np.float32), camera)
    objects = find_objects(mesh, depth, normal, np.zeros_like(inside))
    assert objects.label.max() == 0 and objects.free.all()
    thickness = inflated(objects, depth, 1 / camera.focal)
    true = 2 * (20 - depth[inside])
    assert np.abs(thickness[inside] - true).mean() < 0.08 * true.mean()
    assert (thickness[~inside] == 0).all()
