"""Relief: slopes come from the normals, edges stay where they are sharp."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.predict.bundled.edges import with_relief
from materialist.types import Camera

CAMERA = Camera(64, 48, 50.0)
RAYS = pixel_rays(CAMERA)[..., :2].copy()  # [48, 64, 2]


def _plane(normal, offset):
    """log depth [H, W] and normals [H, W, 3] of the plane n . x = -offset before the camera."""
    normal = np.array(normal) / np.linalg.norm(normal)
    directions = np.concatenate([RAYS, -np.ones((*RAYS.shape[:2], 1))], -1)
    depth = -offset / (directions @ normal)
    return np.log(depth).astype(np.float32), np.broadcast_to(normal, directions.shape).astype(np.float32)


@pytest.mark.parametrize("normal", [(0.1, 0.2, 1), (0, 1, 0.7), (0.8, 0, 0.6)])
def test_texture_printed_onto_a_plane_is_gone(normal):
    true, normals = _plane(normal, 1.5)
    assert np.isfinite(true).all()
    printed = true + np.random.default_rng(0).choice([-0.005, 0, 0.005], true.shape).astype(np.float32)
    found = with_relief(printed, normals, RAYS)
    assert np.abs(found - true).max() < 2e-3


def test_an_edge_stays_where_it_is_sharp():
    far, normals = _plane((0, 0, 1), 3.0)
    sharp = far.copy()
    sharp[10:40, 20:40] -= 0.5
    np.testing.assert_allclose(with_relief(sharp, normals, RAYS), sharp, atol=0.05)


def test_a_steep_side_that_the_depth_flattens_has_no_steps():
    """Normals that ask for more slope than the depth has mark no border of two surfaces: the side stays smooth."""
    true, normals = _plane((1, 0, 0.7), 3.0)
    rng = np.random.default_rng(0)
    flat = 0.4 * true + 0.004 * rng.standard_normal(true.shape).astype(np.float32)
    slope = np.diff(with_relief(flat, normals, RAYS), axis=1)
    asked = np.diff(true, axis=1)
    assert (np.abs(asked) > 0.015).any()
    assert np.abs(slope - asked).max() < 0.6 * np.abs(asked).max()
    assert np.abs(np.diff(slope, axis=1)).max() < 0.01
