"""Surfaces of revolution: balls, rings and pots come out whole, from what one view shows of them."""

import numpy as np
import pytest
from solid_scenes import AXIS, CAMERA, FOOT, GROUND, RAYS, UP, arc, box, lines, turned, view, volume

from materialist.bench.glass_scenes import is_closed
from materialist.solids.finder import surface_of_revolution
from materialist.solids.revolution import Revolution, profile_of, vessel

POT = lines((0.0, 0.0), (0.3, 0.0), (0.3, 0.7), (0.0, 0.7))


def revolved(solid, behind=GROUND):
    """The body around the true axis, and what is seen."""
    front, inside = view(solid)
    depth, normal = front.depth.astype(float), front.normal.astype(float)
    return Revolution(AXIS, profile_of(depth, normal, inside, RAYS, AXIS, behind)), front, inside


@pytest.fixture(scope="module")
def ball():
    return revolved(turned(arc((0, 0.4), 0.4)))


@pytest.fixture(scope="module")
def pot():
    return revolved(turned(POT))


def error(thickness, front, inside):
    return np.abs(thickness - front.thickness)[inside].sum() / front.thickness[inside].sum()


def test_a_ball_comes_out_whole(ball):
    body, front, inside = ball
    assert body.profile.off < 0.3 and body.profile.through < 0.005
    shell = body.body(CAMERA)
    assert is_closed(shell)
    away = shell.vertices - (FOOT + 0.4 * UP)
    assert np.abs(np.linalg.norm(away, axis=1) - 0.4).max() < 0.02
    facing = np.sum(away / np.linalg.norm(away, axis=1, keepdims=True) * shell.normals, -1)
    assert np.degrees(np.arccos(np.clip(facing, -1, 1))).mean() < 2
    assert volume(shell) == pytest.approx(4 / 3 * np.pi * 0.4**3, rel=0.02)
    thick = body.thickness(front.depth.astype(float), inside, RAYS)
    assert error(thick, front, inside) < 0.02 and (thick[~inside] == 0).all()
    hollow = body.body(CAMERA, wall=0.08)
    assert is_closed(hollow) and volume(hollow) < 0.6 * volume(shell)
    inner = np.linalg.norm(hollow.vertices[len(shell.vertices) :] - (FOOT + 0.4 * UP), axis=1)
    assert 0.4 - inner.mean() == pytest.approx(0.08, rel=0.15)


@pytest.mark.parametrize(("centre", "radius"), [((0.4, 0.15), 0.15), ((0.32, 0.2), 0.2)])
def test_the_hole_of_a_ring_stays_open_even_where_it_is_not_seen_to_its_ground(centre, radius):
    body, front, inside = revolved(turned(arc(centre, radius, -180, 180, 120)))
    places = np.array([[0.03, centre[1]], [centre[0] - 1.3 * radius, 0.05], centre, [centre[0] + 1.3 * radius, 0.1]])
    assert (body.profile.at(places) > 0).tolist() == [True, True, False, True]
    shell = body.body(CAMERA)
    assert is_closed(shell) and volume(shell) == pytest.approx(2 * np.pi**2 * centre[0] * radius**2, rel=0.1)
    assert error(body.thickness(front.depth.astype(float), inside, RAYS), front, inside) < 0.05


def test_a_cup_has_a_bottom():
    """Its rim turns inwards as a ring's does, and does not come down to the foot of the outside."""
    outer, inner = lines((0, 0), (0.3, 0), (0.3, 0.55)), lines((0.22, 0.55), (0.22, 0.05), (0, 0.05))
    body, *_ = revolved(turned(np.concatenate([outer, arc((0.26, 0.55), 0.04, 0, 180, 30), inner])))
    assert body.profile.at(np.array([[0.26, 0.3], [0.15, 0.01]])).max() < 0  # wall and bottom are full


def test_a_cylinder_becomes_an_open_pot(pot):
    body, wall = pot[0], 0.05
    shell = body.body(CAMERA, wall=wall, open_top=True)
    assert body.opens(wall) and is_closed(shell)
    place = AXIS.of(shell.vertices.astype(float))
    high = place[:, 1].max() - body.profile.floor
    glass = np.pi * (0.3**2 - 0.25**2) * (high - wall) + np.pi * 0.3**2 * wall
    assert volume(shell) == pytest.approx(glass, rel=0.15)  # the inner corner is round, and full of glass
    assert volume(shell) < volume(body.body(CAMERA, wall=wall)) - 0.5 * np.pi * 0.25**2 * wall  # the lid is gone
    # Along the axis, from above, nothing is met before the bottom; the inside looks at the axis.
    assert place[place[:, 0] < 0.1, 1].max() < body.profile.floor + 1.5 * wall
    facing = AXIS.leaning(shell.vertices.astype(float), shell.normals)[:, 0]
    side = (place[:, 1] > 0.2) & (place[:, 1] < 0.5)
    assert (facing[side & (place[:, 0] > 0.28)] > 0.9).all() and (facing[side & (place[:, 0] < 0.27)] < -0.9).all()
    assert vessel(body.profile, 0.4) is None  # no room inside
    assert vessel(revolved(turned(arc((0.4, 0.15), 0.15, -180, 180)))[0].profile, 0.03) is None  # a ring


@pytest.mark.parametrize("up", [UP, None])
def test_exact_normals_say_where_the_axis_stands(up):
    front, mask = view(turned(POT))
    body, thick = surface_of_revolution(front.depth, front.normal, mask, CAMERA, up=up)
    assert np.degrees(np.arccos(np.clip(body.axis.up @ UP, -1, 1))) < 0.5
    offset = body.axis.foot - FOOT
    assert np.linalg.norm(offset - (offset @ UP) * UP) < 0.01
    assert error(thick, front, mask) < 0.03


def test_boxes_and_half_balls_are_none(ball):
    front, mask = view(box())
    for up in (UP, None):
        assert surface_of_revolution(front.depth, front.normal, mask, CAMERA, up=up) is None
    _, front, mask = ball
    half = mask & (np.indices(mask.shape)[1] < np.median(np.nonzero(mask)[1]))
    assert surface_of_revolution(front.depth, front.normal, half, CAMERA, up=UP) is None
