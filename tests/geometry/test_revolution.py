"""Bodies swept from one profile: balls, rings and bottles come out whole, from what one view shows of them."""

import itertools

import numpy as np
import pytest

from materialist.bench.glass_scenes import is_closed, seen
from materialist.camera import pixel_rays
from materialist.procedural.objects import shapes
from materialist.solids.lathe import lathed
from materialist.solids.profile import fitted
from materialist.solids.revolution import Meridian, fits, profile_of, swept, thickness_of
from materialist.solids.turning import Axis
from materialist.types import Camera

CAMERA = Camera(96, 80, 40.0)
TILT = 0.4
UP = np.array([0, np.cos(TILT), np.sin(TILT)])
FOOT = np.array([0.1, -0.35, -3.0])
AXIS = Axis(UP, FOOT, False)


def standing(profile):
    """A lathed body [[radius, height], ...] on FOOT along UP, as a Solid."""
    solid = shapes.lathe(np.asarray(profile, float), 256)
    right = np.array([1.0, 0, 0])
    frame = np.stack([right, UP, np.cross(right, UP)])  # rows: the body's x, y, z in the camera's frame
    return shapes.Solid(solid.vertices @ frame + FOOT, solid.faces, solid.normals @ frame, solid.uv)


def arc(centre, radius, first=-90, last=90, count=90):
    angle = np.radians(np.linspace(first, last, count))
    return np.stack([centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle)], -1)


def view(solid):
    front = seen(solid, CAMERA)
    return front, front.depth > 0, pixel_rays(CAMERA).astype(float)


def volume(shell):
    a, b, c = (shell.vertices[shell.faces[:, k]].astype(float) for k in range(3))
    return float(np.sum(a * np.cross(b, c)) / 6)


BALL = arc((0, 0.4), 0.4)
RING = np.concatenate([arc((0.4, 0.15), 0.15, -180, 180, 120)])


def profile_from(solid, behind=None):
    front, inside, rays = view(solid)
    found = profile_of(front.depth.astype(float), front.normal.astype(float), inside, rays, AXIS, behind)
    return found, front, inside, rays


@pytest.fixture(scope="module")
def ground():
    """[H, W] planar depth of the plane through FOOT across UP."""
    rays = pixel_rays(CAMERA).astype(float)
    falling = rays @ UP
    return np.where(falling < -1e-3, (FOOT @ UP) / np.where(falling < -1e-3, falling, -1), 0)


def test_a_ball_comes_out_whole(ground):
    found, front, inside, rays = profile_from(standing(BALL), ground)
    assert found is not None and found.off < 0.3 and found.through < 0.005
    shell = swept(found, AXIS, CAMERA)
    assert is_closed(shell)
    centre = FOOT + 0.4 * UP
    away = shell.vertices - centre
    assert np.abs(np.linalg.norm(away, axis=1) - 0.4).max() < 0.02
    turned = np.sum(away / np.linalg.norm(away, axis=1, keepdims=True) * shell.normals, -1)
    assert np.degrees(np.arccos(np.clip(turned, -1, 1))).mean() < 2
    assert volume(shell) == pytest.approx(4 / 3 * np.pi * 0.4**3, rel=0.02)
    thick = thickness_of(found, AXIS, front.depth.astype(float), inside, rays)
    assert np.abs(thick - front.thickness)[inside].sum() < 0.02 * front.thickness[inside].sum()
    assert (thick[~inside] == 0).all()


def test_the_hole_of_a_ring_stays_open(ground):
    found, *_ = profile_from(standing(RING), ground)
    assert found is not None
    places = np.array([[0.05, 0.15], [0.2, 0.15], [0.4, 0.15], [0.6, 0.15]])
    assert (found.at(places) > 0).tolist() == [True, True, False, True]
    shell = swept(found, AXIS, CAMERA)
    assert is_closed(shell)
    assert volume(shell) == pytest.approx(2 * np.pi**2 * 0.4 * 0.15**2, rel=0.1)


def test_a_hole_that_is_not_seen_to_its_ground_goes_on_turning(ground):
    """A doughnut from low: of its hole the upper quarter is seen."""
    solid = standing(arc((0.32, 0.2), 0.2, -180, 180, 120))
    found, front, inside, rays = profile_from(solid, ground)
    assert found is not None and found.seen[found.seen[:, 0] < 0.3, 1].min() > 0.2
    places = np.array([[0.03, 0.05], [0.05, 0.2], [0.16, 0.2], [0.2, 0.1]])
    assert (found.at(places) > 0).tolist() == [True, True, False, False]
    assert volume(swept(found, AXIS, CAMERA)) == pytest.approx(2 * np.pi**2 * 0.32 * 0.2**2, rel=0.02)
    thick = thickness_of(found, AXIS, front.depth.astype(float), inside, rays)
    assert np.abs(thick - front.thickness)[inside].sum() < 0.03 * front.thickness[inside].sum()


def test_a_cup_has_a_bottom(ground):
    """Its rim turns inwards as a ring's does, and does not come down to the foot of the outside."""
    wall = np.array([(0, 0), (0.3, 0), (0.3, 0.55)])
    rim, inner = arc((0.26, 0.55), 0.04, 0, 180, 30), np.array([(0.22, 0.55), (0.22, 0.05), (0, 0.05)])
    step = np.linspace(0.001, 0.999, 60)[:, None]
    lines = [a + step * (b - a) for part in (wall, inner) for a, b in itertools.pairwise(part)]
    found, *_ = profile_from(standing(np.concatenate([*lines[:2], rim, *lines[2:]])), ground)
    assert found is not None
    assert found.at(np.array([[0.26, 0.3], [0.15, 0.01]])).max() < 0  # wall and bottom are full


def test_edges_keep_their_normals(ground):
    """A cylinder: its side looks aside, its top up, and there is little between."""
    step = np.linspace(0.001, 0.999, 60)[:, None]
    corners = np.array([(0, 0), (0.35, 0), (0.35, 0.7), (0, 0.7)])
    sides = np.concatenate([a + step * (b - a) for a, b in itertools.pairwise(corners)])
    found, *_ = profile_from(standing(sides), ground)
    assert found is not None
    shell = swept(found, AXIS, CAMERA)
    height = (shell.vertices - FOOT) @ UP
    middle = (height > 0.05) & (height < 0.65)
    assert np.abs(shell.normals[middle] @ UP).max() < 0.05
    assert volume(shell) == pytest.approx(np.pi * 0.35**2 * 0.7, rel=0.03)


def test_a_wall_makes_it_hollow(ground):
    found, *_ = profile_from(standing(BALL), ground)
    solid, hollow = swept(found, AXIS, CAMERA), swept(found, AXIS, CAMERA, wall=0.08)
    assert is_closed(hollow)
    assert len(hollow.vertices) > 1.5 * len(solid.vertices) and volume(hollow) < 0.6 * volume(solid)
    away = np.linalg.norm(hollow.vertices[len(solid.vertices) :] - (FOOT + 0.4 * UP), axis=1)
    assert 0.4 - away.mean() == pytest.approx(0.08, rel=0.15)


def test_it_stays_above_the_ground(ground):
    high = ground * 0.97
    found, *_ = profile_from(standing(BALL), np.where(ground > 0, high, 0))
    lowest = ((swept(found, AXIS, CAMERA).vertices - FOOT) @ UP).min()
    rays = pixel_rays(CAMERA).astype(float)
    inside = view(standing(BALL))[1] & (high > 0)
    assert lowest > np.percentile((rays * high[..., None] - FOOT)[inside] @ UP, 2)


def test_what_is_no_body_of_revolution_has_no_profile():
    front, inside, rays = view(standing(BALL))
    columns = np.indices(inside.shape)[1]
    half = inside & (columns < np.median(columns[inside]))
    assert not fits(profile_of(front.depth.astype(float), front.normal.astype(float), half, rays, AXIS))
    assert lathed(front.depth, front.normal, half, CAMERA, up=UP) is None


def test_the_function_goes_on_as_it_went():
    """Points of the upper half of a circle around the axis: the lower half follows by its curvature."""
    angle = np.radians(np.linspace(0, 90, 200))
    lean = np.stack([np.cos(angle), np.sin(angle)], -1)
    found = fitted(0.5 * lean + [0, 1.0], lean, np.zeros((0, 2)), 0.01, 0.4)
    (line, normals), *_ = found.lines()
    assert np.abs(np.linalg.norm(line - [0, 1.0], axis=1) - 0.5).max() < 0.03
    assert np.sum((line - [0, 1.0]) * normals, -1).min() > 0.4


def test_places_beside_the_axis():
    plane = Meridian(AXIS)
    point = FOOT + 0.3 * UP + np.array([0.2, 0, 0])
    assert plane.of(point) == pytest.approx([0.2, 0.3])
    assert plane.leaning(point[None], np.array([[1.0, 0, 0]]))[0] == pytest.approx([1, 0])
