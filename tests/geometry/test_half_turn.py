"""Upright bodies seen from above: a half turn finds their backs where the mirror does not."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.solids.half_turn import half_turn, upright
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Camera

CAMERA = Camera(80, 64, 40.0)
TILT = 0.35
UP = np.array([0, np.cos(TILT), np.sin(TILT)])


def cylinder(radius=0.5, height=0.9, middle=(0.1, 0.0, -3.0)):
    """Depth, normal, mask and thickness of an upright cylinder, seen from above: slab and tube, in closed form."""
    rays = pixel_rays(CAMERA).astype(float)
    up, middle = UP, np.asarray(middle)
    along, flat = rays @ up, rays - (rays @ up)[..., None] * up
    off = middle - (middle @ up) * up
    a, b, c = (flat**2).sum(-1), flat @ off, off @ off - radius**2
    root = b * b - a * c
    tube = (b + np.sqrt(np.maximum(root, 0)) * np.array([[[-1]], [[1]]])) / a  # [2, H, W]
    slab = np.sort((middle @ up + np.array([[[-0.5]], [[0.5]]]) * height) / along, 0)
    enter, leave = np.maximum(tube[0], slab[0]), np.minimum(tube[1], slab[1])
    mask = (root > 0) & (leave > enter)
    point = rays * enter[..., None] - middle
    side = (point - (point @ up)[..., None] * up) / radius
    normal = np.where((slab[0] > tube[0])[..., None], up, side)
    length = np.linalg.norm(rays, axis=-1)
    wall = np.array([0.0, 0, 1])
    thick = np.where(mask, leave - enter, 0) * length
    return np.where(mask, enter, 6.0), np.where(mask[..., None], normal, wall), mask, thick


def error(found, true, mask):
    return np.abs(found - true)[mask].sum() / true[mask].sum()


@pytest.mark.parametrize("up", [UP, None])
def test_a_cylinder_seen_from_above(up):
    depth, normal, mask, true = cylinder()
    guess = true * (1 + 0.4 * np.sin(np.arange(80) / 3) * np.cos(np.arange(64) / 4)[:, None])
    found = half_turn(depth, normal, mask, guess, CAMERA, up=up)
    assert found.misfit < 0.06 and found.trust == 1
    assert np.degrees(np.arccos(np.clip(found.up @ UP, -1, 1))) < 7
    turned = error(found.thickness, true, mask)
    assert turned < 0.15 and turned < 0.9 * error(guess, true, mask)
    assert turned < 0.5 * error(symmetric_thickness(depth, normal, mask, CAMERA), true, mask)
    assert (found.thickness[~mask] == 0).all()


def test_the_guess_decides_how_deep_the_axis_stands():
    depth, normal, mask, true = cylinder()
    right = half_turn(depth, normal, mask, true, CAMERA, up=UP)
    assert error(right.thickness, true, mask) < 0.12
    thin = half_turn(depth, normal, mask, 0.5 * true, CAMERA, up=UP)
    assert thin.thickness[mask].mean() < 0.8 * right.thickness[mask].mean()
    # The axis runs through the middle of the cylinder.
    offset = right.foot - np.array([0.1, 0, -3.0])
    assert np.linalg.norm(offset - (offset @ UP) * UP) < 0.08


def test_one_half_of_a_thing_is_no_image_of_the_other():
    depth, normal, mask, true = cylinder()
    whole = half_turn(depth, normal, mask, true, CAMERA, up=UP)
    boot = mask.copy()
    boot[:32, :40] = False
    assert half_turn(depth, normal, boot, true, CAMERA, up=UP).misfit > whole.misfit + 0.02


def test_the_floor_tells_what_is_upright():
    rays = pixel_rays(CAMERA).astype(float)
    floor = np.maximum(-1.0 / np.minimum(rays @ UP, -1e-3), 0)
    seen = (rays @ UP) < -0.05
    depth = np.where(seen, floor, 8.0)
    normal = np.where(seen[..., None], UP, [0, 0, 1.0])
    plane = np.where(seen, 1, 0)
    assert upright(depth, normal, plane, CAMERA) @ UP > 0.9999
    assert upright(depth, normal, np.where(seen, -1, 0), CAMERA) is None  # a wall says nothing


def test_maps_of_another_size_are_refused():
    depth, normal, mask, true = cylinder()
    with pytest.raises(InputError):
        half_turn(depth[1:], normal, mask, true, CAMERA)
