"""Shifts under which a plane looks like itself, against the lattice it was painted with."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.edits.remove.periods import Surface, periods
from materialist.types import Camera

CAMERA = Camera(120, 96, 50)
NORMAL = np.array([0.25, 0.6, 0.9]) / np.linalg.norm([0.25, 0.6, 0.9])
RIGHT = np.cross(NORMAL, [0, 1.0, 0]) / np.linalg.norm(np.cross(NORMAL, [0, 1.0, 0]))
AXES = np.stack([RIGHT, np.cross(NORMAL, RIGHT)])


def plane():
    """A leaning plane with a hole, and the coordinates [H, W] of its places along AXES."""
    rays = pixel_rays(CAMERA).astype(float)
    point = rays * (-2 * NORMAL[2] / (rays @ NORMAL))[..., None]
    rows, columns = np.indices(point.shape[:2])
    hidden = np.hypot(rows - 50, columns - 62) < 19
    return Surface(point, ~hidden, hidden), point @ AXES.T


def painted(at, tile, seed=0, soft=0.02):
    """[H, W, 3]: discs at random on a tile (u, v) that repeats, edges `soft` wide."""
    rng = np.random.default_rng(seed)
    found = np.zeros(at.shape[:2])
    for x, y, r in np.c_[rng.uniform(0, tile, (12, 2)), rng.uniform(0.04, 0.08, 12)]:
        away = [(at[..., k] - c + t / 2) % t - t / 2 for k, (c, t) in enumerate(zip((x, y), tile, strict=True))]
        found = np.maximum(found, np.clip((r - np.hypot(*away)) / soft + 0.5, 0, 1))
    return np.stack([0.3 + 0.5 * found, 0.2 + 0.6 * found, 0.2 + 0.2 * found], -1)


@pytest.mark.parametrize("tile", [(0.4, 0.5), (0.62, 0.55), (0.3, 0.3)])
def test_shifts_are_those_of_the_tile(tile):
    surface, at = plane()
    shifts, cell = periods(painted(at, tile), surface, CAMERA)
    assert len(shifts) >= 2
    np.testing.assert_allclose(shifts @ NORMAL, 0, atol=1e-9)  # along the plane
    steps = shifts @ AXES.T / tile
    size = np.linalg.norm(cell, axis=1).max()
    assert np.abs(steps - np.round(steps)).max() * max(tile) < 1.5 * size  # to a cell and a half
    assert np.abs(np.round(steps)).max(1).min() >= 1  # none is no shift at all


def test_the_cell_is_a_step_along_the_plane_for_both_axes():
    surface, at = plane()
    _, cell = periods(painted(at, (0.4, 0.5)), surface, CAMERA)
    np.testing.assert_allclose(cell @ NORMAL, 0, atol=1e-9)
    assert np.linalg.norm(cell[0]) == pytest.approx(np.linalg.norm(cell[1]))
    assert cell[0] @ cell[1] == pytest.approx(0, abs=1e-12)
    extent = np.ptp(at[surface.known], axis=0).max()
    assert extent / 400 < np.linalg.norm(cell[0]) < extent / 100


def test_plain_paint_slow_light_and_a_sliver_repeat_never():
    surface, at = plane()
    noise = np.random.default_rng(0).normal(0, 0.004, (*at.shape[:2], 3))
    slow = 0.5 + 0.1 * at[..., :1] + noise
    assert len(periods(slow, surface, CAMERA)[0]) == 0
    sliver = np.zeros_like(surface.known)
    sliver[:2] = True
    few = Surface(surface.point, sliver & surface.known, surface.hidden)
    assert len(periods(painted(at, (0.4, 0.5)), few, CAMERA)[0]) == 0
