"""Depth integrated from normals: planes and spheres come back, steps stay, painted edges go."""

import numpy as np
import pytest
from geometry_scenes import plane_depth, sphere_depth

from materialist.camera import pixel_rays, unit
from materialist.geometry.integrate import _Grid, integrated
from materialist.predict.normals import normals_from_depth
from materialist.types import Camera

CAMERA = Camera(96, 72, 50.0)
RAYS = pixel_rays(CAMERA)


def _plane(normal, offset=-3.0):
    """Depth [H, W] and normals [H, W, 3] of the plane n . p = offset."""
    normal = unit(np.asarray(normal, float))
    depth = plane_depth(CAMERA, normal, offset)
    assert np.isfinite(depth).all()
    return depth, np.broadcast_to(normal, RAYS.shape).astype(np.float32)


def _log_error(depth, true):
    """[H, W] error of log depth after one factor."""
    error = np.log(depth / true)
    return error - np.median(error)


def _angle(depth, normal):
    """Median angle, degrees, between the normals of a depth map and a normal map."""
    cosine = (normals_from_depth(depth, CAMERA) * normal).sum(-1)
    return np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1))))


@pytest.mark.parametrize("normal", [(0.1, 0.2, 1), (0.5, 0, 0.8), (0, 1, 0.7)])
def test_right_depth_stays_as_it_is(normal):
    true, normals = _plane(normal)
    np.testing.assert_allclose(integrated(true, normals, RAYS), true, rtol=2e-3)


@pytest.mark.parametrize("normal", [(0.3, 0.2, 1), (-0.4, 0, 1), (0, 0.6, 1)])
def test_a_tilted_plane_that_the_depth_bends_comes_back(normal):
    true, normals = _plane(normal)
    rows, columns = np.indices(true.shape)
    wrong = true * np.exp(0.1 * np.sin(columns / 8) * np.sin(rows / 8))
    assert _angle(wrong, normals) > 15
    depth = integrated(wrong, normals, RAYS)
    assert _angle(depth, normals) < 4
    assert np.std(_log_error(depth, true)) < 0.3 * np.std(_log_error(wrong, true))


@pytest.mark.parametrize("normal", [(0.3, 0.2, 1), (-0.4, 0, 1)])
def test_a_plane_that_the_depth_leans_otherwise_over_the_whole_picture_is_a_compromise(normal):
    true, normals = _plane(normal)
    wrong, _ = _plane((0.05, -0.1, 1))
    depth = integrated(wrong, normals, RAYS)
    assert _angle(depth, normals) < 0.5 * _angle(wrong, normals)
    assert np.abs(_log_error(depth, true)).max() < 0.6 * np.abs(_log_error(wrong, true)).max()


def test_texture_that_is_printed_onto_a_plane_is_gone():
    true, normals = _plane((0.2, 0.5, 1))
    printed = true * np.exp(np.random.default_rng(0).choice([-0.005, 0.005], true.shape))
    assert np.abs(_log_error(integrated(printed, normals, RAYS), true)).max() < 2e-3


def test_a_sphere_comes_back_from_a_flat_disc_before_a_wall():
    sphere, normal = sphere_depth(CAMERA, (0, 0, -6.0), 1.5)
    ball = np.isfinite(sphere)
    true = np.where(ball, sphere, 9.0)
    normals = np.where(ball[..., None], normal, [0, 0, 1]).astype(np.float32)
    depth = integrated(np.where(ball, 5.0, 9.0), normals, RAYS)
    assert _angle(np.where(ball, depth, 0), normals) < 2
    middle = ball & ((normals * unit(RAYS)).sum(-1) < -0.5)
    error = np.log(depth / true)
    assert np.std(error[middle]) < 0.3 * np.std(np.log(5.0 / true)[middle])
    np.testing.assert_allclose(depth[~ball], 9.0, rtol=0.02)


@pytest.mark.parametrize("near", [2.0, 2.7])
def test_a_true_step_stays_at_its_height_and_place(near):
    true, normals = _plane((0, 0, 1))
    true[20:50, 30:60] = near
    np.testing.assert_allclose(integrated(true, normals, RAYS), true, rtol=0.01)


def test_the_step_of_a_painted_edge_that_ends_on_the_surface_is_closed():
    true, normals = _plane((0.1, 0.3, 1))
    stepped = true.copy()
    stepped[:, 30:60] *= 1 + 0.01 * np.clip((40 - np.arange(72)) / 10, 0, 1)[:, None]
    depth = integrated(stepped, normals, RAYS)
    assert np.abs(_log_error(depth, true)).max() < 0.3 * np.abs(_log_error(stepped, true)).max()


def test_the_blurred_rim_of_a_thing_joins_one_of_its_sides():
    true, normals = _plane((0, 0, 1))
    true[20:23, 30:60] = 2.0
    blurred = true.copy()
    blurred[20:23, [29, 60]] = 2.4
    depth = integrated(blurred, normals, RAYS)
    rim = depth[20:23, [29, 60]]
    assert (np.minimum(np.abs(rim - 2), np.abs(rim - 3)) < 0.05).all()


def test_sky_and_tiny_surfaces_stay():
    true, normals = _plane((0.2, 0, 1))
    true[:20] = 0
    depth = integrated(true, normals, RAYS)
    assert (depth[:20] == 0).all() and (depth[20:] > 0).all()
    speck = np.zeros_like(true)
    speck[4, 5:8] = 2
    np.testing.assert_array_equal(integrated(speck, normals, RAYS), speck.astype(np.float32))


def test_a_pull_below_single_precision_leaves_the_system_solvable():
    true, normals = _plane((0, 0, 1))
    grid = _Grid.of(true > 0, normals, RAYS)
    data = np.log(true.ravel())
    # Two pixels that hold to each other alone, pulled less than single precision resolves.
    pair = np.isin(np.arange(true.size), [500, 501])
    linked = pair[grid.first] == pair[grid.second]
    pull = np.where(pair, 1e-9, 1e-3)
    solved = grid.solved(linked.astype(float), pull, data, data + 0.01)
    np.testing.assert_allclose(solved[~pair], data[~pair], atol=1e-3)
    assert np.isfinite(solved).all()
