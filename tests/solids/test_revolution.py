"""Surfaces of revolution as bodies: closed, hollow, and open at the top."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from solid_scenes import CAMERA, FOOT, GROUND, RAYS, UP, arc, lines, turned, view, volume

from materialist.camera import unit
from materialist.solids.outline import surface_of_revolution
from materialist_lab.bench.glass_scenes import is_closed


def revolved(profile):
    """The body, its thickness, and what is seen of the true one."""
    front, mask = view(turned(profile))
    body, thick = surface_of_revolution(
        front.depth, front.normal, mask, CAMERA, up=UP, behind=GROUND
    )
    return body, thick, front, mask


@pytest.fixture(scope="module")
def ball():
    return revolved(arc((0, 0.4), 0.4))


@pytest.fixture(scope="module")
def pot():
    return revolved(lines((0.0, 0.0), (0.3, 0.0), (0.3, 0.7), (0.0, 0.7)))


def error(thickness, front, mask):
    return np.abs(thickness - front.thickness)[mask].sum() / front.thickness[mask].sum()


def test_a_ball_comes_out_whole(ball):
    body, thick, front, mask = ball
    shell = body.body(CAMERA)
    assert is_closed(shell)
    away = shell.vertices - (FOOT + 0.4 * UP)
    assert np.abs(np.linalg.norm(away, axis=1) - 0.4).max() < 0.02
    facing = np.sum(away / np.linalg.norm(away, axis=1, keepdims=True) * shell.normals, -1)
    assert np.degrees(np.arccos(np.clip(facing, -1, 1))).mean() < 3
    assert volume(shell) == pytest.approx(4 / 3 * np.pi * 0.4**3, rel=0.02)
    assert error(thick, front, mask) < 0.02 and (thick[~mask] == 0).all()
    hollow = body.body(CAMERA, wall=0.08)
    assert is_closed(hollow) and volume(hollow) < 0.6 * volume(shell)
    inner = np.linalg.norm(hollow.vertices[len(shell.vertices) :] - (FOOT + 0.4 * UP), axis=1)
    assert 0.4 - inner.mean() == pytest.approx(0.08, rel=0.15)


def test_its_axis_and_front_are_those_of_the_object(pot):
    body, thick, front, mask = pot
    assert np.degrees(np.arccos(np.clip(body.axis.up @ UP, -1, 1))) < 0.5
    offset = body.axis.foot - FOOT
    assert np.linalg.norm(offset - (offset @ UP) * UP) < 0.03
    depth, normal = body.front(mask, RAYS)
    there = mask & (depth > 0)
    assert not normal[~there].any() and not body.front(np.ones_like(mask), RAYS)[1][0, 0].any()
    assert there.sum() > 0.97 * mask.sum() and error(thick, front, mask) < 0.06
    assert np.abs(depth - front.depth)[there].mean() < 0.02
    assert np.degrees(np.arccos(np.clip((normal * front.normal).sum(-1), -1, 1)))[there].mean() < 8


@pytest.mark.parametrize("lean", [10, 12])
def test_its_outline_corrects_an_axis_seen_too_much_from_above(lean):
    front, mask = view(turned(lines((0.0, 0.0), (0.3, 0.0), (0.3, 0.7), (0.0, 0.7))))
    way = FOOT / np.linalg.norm(FOOT)
    toward = Rotation.from_rotvec(-np.radians(lean) * unit(np.cross(UP, way))).apply(UP)
    body, _ = surface_of_revolution(
        front.depth, front.normal, mask, CAMERA, up=toward, behind=GROUND
    )
    assert toward @ way < UP @ way  # seen more from above
    assert np.degrees(np.arccos(np.clip(body.axis.up @ UP, -1, 1))) < 0.6 * lean


def test_a_hidden_foot_leans_no_axis():
    front, mask = view(turned(arc((0, 0.4), 0.4)))
    seen = mask.copy()
    seen[int(np.quantile(np.flatnonzero(mask.any(1)), 0.75)) :] = False
    # Something nearer hides the foot.
    depth = np.where(seen, front.depth, 0.8 * front.depth[mask].min())
    assert surface_of_revolution(depth, front.normal, seen, CAMERA, up=UP) is None


def test_a_cylinder_becomes_an_open_pot(pot, ball):
    body = pot[0]
    wall = 0.05
    shell = body.vessel(CAMERA, wall)
    assert is_closed(shell)
    place = body.axis.of(shell.vertices.astype(float)) - [0, body.profile.floor]
    high = place[:, 1].max()
    glass = np.pi * (0.3**2 - 0.25**2) * (high - wall) + np.pi * 0.3**2 * wall
    assert volume(shell) == pytest.approx(
        glass, rel=0.15
    )  # the inner corner is round, and full of glass
    assert (
        volume(shell) < volume(body.body(CAMERA, wall=wall)) - 0.5 * np.pi * 0.25**2 * wall
    )  # the lid is gone
    # Along the axis, from above, nothing is met before the bottom; the inside looks at the axis.
    assert place[place[:, 0] < 0.1, 1].max() < 1.5 * wall
    away = shell.vertices - body.axis.foot
    out = away - (away @ body.axis.up)[:, None] * body.axis.up
    facing = (shell.normals * out).sum(1) / np.maximum(np.linalg.norm(out, axis=1), 1e-9)
    side = (place[:, 1] > 0.2) & (place[:, 1] < 0.5)
    assert (facing[side & (place[:, 0] > 0.28)] > 0.9).all() and (
        facing[side & (place[:, 0] < 0.27)] < -0.9
    ).all()
    assert body.vessel(CAMERA, 0.4) is None  # no room inside
