"""Bodies are set before what stands behind them, and look the same."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_lathe import CAMERA, FOOT, UP, prism, solid

from materialist.camera import pixel_rays, project
from materialist.solids.lathe import lathed
from materialist.solids.standing import BEYOND, NEAREST, nearer, standing_body

RAYS = pixel_rays(CAMERA)
CAMERA_SHAPE = (CAMERA.height, CAMERA.width)


def ground(height=0.0):
    """Planar depth of the ground that the prisms of test_lathe stand on, raised by `height`; 6 above its horizon."""
    facing = RAYS @ UP
    along = (UP @ FOOT + height) / np.where(np.abs(facing) < 1e-9, 1e-9, facing)
    return np.where((along > 0) & (along < 6), along, 6.0)


def body(way, behind, wall=None):
    """The body of a cylinder before `behind`, and its mask."""
    depth, normal, mask, thick = solid(prism(180))
    lathe = lathed(depth, normal, mask, CAMERA, up=UP) if way == "lathe" else None
    found = SimpleNamespace(solid=thick.astype(np.float32), back=None, lathe=lathe)
    return standing_body(depth, normal, mask, found, CAMERA, behind=behind, wall=wall), mask


@pytest.mark.parametrize("way", ["lathe", "closed"])
def test_what_has_its_room_stays(way):
    far, _ = body(way, np.full(CAMERA_SHAPE, 9.0))
    on_the_ground, _ = body(way, ground())
    if way == "lathe":
        np.testing.assert_array_equal(far.vertices, on_the_ground.vertices)
    assert abs(far.vertices[:, 2].max() - on_the_ground.vertices[:, 2].max()) < 1e-3


@pytest.mark.parametrize("way", ["lathe", "closed"])
@pytest.mark.parametrize("wall", [None, 0.05])
def test_what_reaches_through_the_ground_comes_nearer_and_looks_the_same(way, wall):
    own, mask = body(way, np.full(CAMERA_SHAPE, 9.0), wall)
    moved, _ = body(way, ground(0.25), wall)
    factor = moved.vertices[:, 2].max() / own.vertices[:, 2].max()
    assert NEAREST <= factor < 0.95
    first, last = (np.sort(np.linalg.norm(s.vertices, axis=1)) for s in (own, moved))
    if way == "lathe":
        np.testing.assert_allclose(moved.vertices, factor * own.vertices, rtol=1e-5)
        np.testing.assert_allclose(project(moved.vertices, CAMERA)[0], project(own.vertices, CAMERA)[0], atol=1e-3)
        np.testing.assert_array_equal(moved.normals, own.normals)
    else:
        assert last[0] == pytest.approx(factor * first[0], rel=1e-3)
    place, ahead = project(moved.vertices, CAMERA)
    column, row = np.clip(np.floor(place).astype(int), 0, [CAMERA.width - 1, CAMERA.height - 1]).T
    seen = mask[row, column]
    assert (ahead[seen] > 1.001 * ground(0.25)[row, column][seen]).mean() < 1.2 * BEYOND


def test_the_factor_is_what_the_points_need():
    mask, behind = np.ones(CAMERA_SHAPE, bool), np.full(CAMERA_SHAPE, 2.0)
    points = (RAYS * 2.2).reshape(-1, 3)
    assert nearer(points, mask, behind, CAMERA) == pytest.approx(2.0 / 2.2)
    assert nearer(points, mask, 10 * behind, CAMERA) == 1.0
    assert nearer(points, mask, 0 * behind, CAMERA) == 1.0  # nothing stands behind
    assert nearer(points, ~mask, behind, CAMERA) == 1.0
    assert nearer(3 * points, mask, behind, CAMERA) == NEAREST
    assert nearer(points, mask, 1.095 * behind, CAMERA) == 1.0  # no better known than that
    few = np.where(np.arange(CAMERA.width) < 0.5 * BEYOND * CAMERA.width, 2.0, 9.0) * np.ones(CAMERA_SHAPE)
    assert nearer(points, mask, few, CAMERA) == 1.0
