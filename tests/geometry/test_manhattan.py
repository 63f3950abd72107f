"""The directions of a building are known by its straight edges; floors and walls follow them, round things do not."""

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from materialist.camera import pixel_rays, project, unit
from materialist.geometry.manhattan import drawn_to_axes, manhattan_axes
from materialist.types import Camera

CAMERA = Camera(320, 240, 60.0)
RAYS = pixel_rays(CAMERA).astype(np.float64)
AXES = Rotation.from_euler("xy", [20, 25], degrees=True).as_matrix().T
"""Rows: the room's directions in the camera frame."""


def between(a, b):
    """Degrees between unit vectors [..., 3]."""
    return np.degrees(np.arccos(np.clip((a * b).sum(-1), -1, 1)))


@pytest.fixture(scope="module")
def room():
    """A picture of a floor and two walls with joints, their normals and depth: faces of a box around the camera."""
    depth = np.full(RAYS.shape[:2], np.inf)
    normal = np.zeros_like(RAYS)
    for axis, away in ((AXES[1], -1.2), (AXES[0], -2.5), (AXES[0], 2.5), (AXES[2], -4.0)):
        met = away / (RAYS @ axis)
        nearer = (met > 0) & (met < depth)
        depth[nearer] = met[nearer]
        normal[nearer] = -np.sign(away) * axis
    known = np.isfinite(depth)
    points = np.where(known[..., None], RAYS * np.where(known, depth, 0)[..., None], 0)
    # Joints every half unit along the directions of each face.
    picture = np.full((*depth.shape, 3), 0.7, np.float32)
    place = points @ AXES.T
    for k in range(3):
        across = np.abs(np.mod(place[..., k], 0.5) - 0.25) > 0.235
        picture[across & (np.abs(normal @ AXES[k]) < 0.5) & known] = 0.2
    return picture, normal, np.where(known, depth, 0)


def off(normal, degrees):
    """Normals turned by so many degrees about an axis that is none of the room's."""
    turn = Rotation.from_rotvec(np.radians(degrees) * unit(np.array([1.0, 0.4, -0.3])))
    return turn.apply(normal.reshape(-1, 3)).reshape(normal.shape)


def test_the_directions_of_a_room_are_known_by_its_edges(room):
    picture, normal, depth = room
    axes = manhattan_axes(picture, off(normal, 12), depth, RAYS)
    assert axes.shape == (3, 3)
    best = np.abs(axes @ AXES.T).max(0)
    assert np.degrees(np.arccos(best)).max() < 1.5
    # The mirror image has the mirrored ones.
    turn = np.array([-1, 1, 1])
    mirrored = manhattan_axes(
        np.ascontiguousarray(picture[:, ::-1]),
        off(normal, 12)[:, ::-1] * turn,
        depth[:, ::-1],
        RAYS[:, ::-1] * turn,
    )
    assert np.allclose(np.abs((mirrored * turn) @ axes.T).max(0), 1, atol=1e-3)


def test_without_straight_edges_or_normals_along_them_there_are_none(room):
    picture, normal, depth = room
    noise = np.random.default_rng(0).random(picture.shape).astype(np.float32)
    assert not len(manhattan_axes(noise, normal, depth, RAYS))
    assert not len(manhattan_axes(np.full_like(picture, 0.5), normal, depth, RAYS))
    assert not len(manhattan_axes(picture, normal, np.zeros_like(depth), RAYS))  # all sky
    for small in (np.s_[:1, :1], np.s_[:5, :40]):
        cut = manhattan_axes(picture[small], normal[small], depth[small], RAYS[small])
        assert not len(cut)
        assert np.array_equal(drawn_to_axes(normal, depth, RAYS, cut), normal)
    diagonal = np.broadcast_to(unit(AXES.sum(0)), normal.shape)
    assert not len(manhattan_axes(picture, diagonal, depth, RAYS))


def test_stripes_alone_tell_no_frame(room):
    _, normal, depth = room
    stripes = np.where(np.indices(depth.shape)[1] % 4 < 2, 0.2, 0.7).astype(np.float32)
    picture = np.repeat(stripes[..., None], 3, -1)
    assert not len(manhattan_axes(picture, normal, depth, RAYS))


def test_axes_that_turn_surfaces_away_are_wrong():
    seen = np.broadcast_to(unit(np.array([1.0, 0.0, 0.62])), RAYS.shape)
    assert ((seen * -RAYS).sum(-1) > 0).all()
    depth = np.ones(RAYS.shape[:2])
    # The second axis faces away from the rays at the right.
    for x, drawn in ((0.8, True), (0.35, False)):
        axes = unit(np.array([[1.0, 0.0, x]]))
        result = drawn_to_axes(seen, depth, RAYS, axes)
        assert (between(result, seen).max() > 3) == drawn


@pytest.mark.parametrize("degrees", [8, 13])
def test_floors_and_walls_are_drawn_to_it(room, degrees):
    _, normal, depth = room
    predicted = off(normal, degrees)
    drawn = drawn_to_axes(predicted, depth, RAYS, AXES)
    known = depth > 0
    assert np.allclose(np.linalg.norm(drawn[known], axis=-1), 1, atol=1e-4)
    assert np.median(between(drawn, normal)[known]) < 1
    assert between(drawn, normal)[known].mean() < 0.2 * degrees
    # What is as far from one axis as from the others stays.
    slanted = np.broadcast_to(unit(AXES.sum(0)), normal.shape)
    assert np.allclose(drawn_to_axes(slanted, depth, RAYS, AXES), slanted, atol=1e-4)


def test_relief_stays_and_so_does_a_ball(room):
    _, normal, depth = room
    rows, columns = np.indices(depth.shape)
    # --- Relief finer than a floor's bend ---
    relief = unit(off(normal, 8) + 0.2 * np.sin(2.5 * columns)[..., None] * AXES[2])
    drawn = drawn_to_axes(relief, depth, RAYS, AXES)
    floor = normal @ AXES[1] > 0.9
    waves = (drawn @ AXES[2])[floor]
    assert waves.std() > 0.7 * (relief @ AXES[2])[floor].std()
    # --- A ball in front of the wall ---
    middle, ahead = project(np.array([[0.1, 0.2, -2.0]]), CAMERA)
    assert ahead.all()
    x = (columns - middle[0, 0]) / 45
    y = -(rows - middle[0, 1]) / 45
    ball = x**2 + y**2 < 1
    front = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], -1)
    with_ball = np.where(ball[..., None], front, off(normal, 8))
    nearer = np.where(ball, 2 - 0.3 * front[..., 2], depth)
    drawn = drawn_to_axes(with_ball, nearer, RAYS, AXES)
    inside = cv2.erode(ball.astype(np.uint8), np.ones((9, 9), np.uint8)) > 0
    assert np.quantile(between(drawn, with_ball)[inside], 0.9) < 3
