"""What was turned on a lathe is found by its normals alone; other things are not taken for it."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.solids.lathe import lathed
from materialist.types import Camera

CAMERA = Camera(80, 64, 40.0)
TILT = 0.35
UP = np.array([0, np.cos(TILT), np.sin(TILT)])
FOOT = np.array([0.1, -0.4, -3.0])


def solid(side):
    """Depth, normal, mask and thickness of the upright prism of height 0.9 that planes [N, 4] (normal across the axis,
    distance from it) bound: between them every ray runs through one piece."""
    rays = pixel_rays(CAMERA).astype(float)
    planes = [(n, n @ FOOT + d) for n, d in side]
    planes += [(UP, UP @ FOOT + 0.9), (-UP, -UP @ FOOT)]
    enter, leave = np.full(rays.shape[:2], -np.inf), np.full(rays.shape[:2], np.inf)
    normal = np.zeros(rays.shape)
    for n, d in planes:
        facing = rays @ n
        at = d / np.where(np.abs(facing) < 1e-9, 1e-9, facing)
        first = (facing < 0) & (at > enter)
        enter, normal = np.where(first, at, enter), np.where(first[..., None], n, normal)
        leave = np.where((facing > 0) & (at < leave), at, leave)
    mask = (leave > enter) & (enter > 0)
    thick = np.where(mask, leave - enter, 0) * np.linalg.norm(rays, axis=-1)
    return np.where(mask, enter, 6.0), np.where(mask[..., None], normal, [0, 0, 1.0]), mask, thick


def prism(count, radius=0.45, turn=0.2):
    """Planes of a prism of so many sides."""
    right = np.array([1.0, 0, 0])
    ahead = np.cross(right, UP)
    angles = turn + 2 * np.pi * np.arange(count) / count
    return [(np.cos(a) * right + np.sin(a) * ahead, radius) for a in angles]


@pytest.mark.parametrize("up", [UP, None])
def test_a_cylinder_is_found_without_a_guess(up):
    depth, normal, mask, true = solid(prism(180))
    found = lathed(depth, normal, mask, CAMERA, up=up)
    assert found is not None and found.misfit < 0.02
    assert np.degrees(np.arccos(np.clip(found.axis.up @ UP, -1, 1))) < 0.5
    offset = found.axis.foot - FOOT
    assert np.linalg.norm(offset - (offset @ UP) * UP) < 0.01
    assert np.abs(found.thickness - true)[mask].sum() < 0.03 * true[mask].sum()
    assert (found.thickness[~mask] == 0).all()


def test_a_box_was_not_turned_on_a_lathe():
    depth, normal, mask, _ = solid(prism(4, turn=0.5))
    assert lathed(depth, normal, mask, CAMERA) is None
    assert lathed(depth, normal, mask, CAMERA, up=UP) is None


def test_rough_normals_are_not_believed():
    depth, normal, mask, _ = solid(prism(180))
    noisy = normal + np.random.default_rng(0).normal(0, 0.1, normal.shape)
    noisy /= np.linalg.norm(noisy, axis=-1, keepdims=True)
    assert lathed(depth, noisy, mask, CAMERA) is None


def test_a_cylinder_with_a_block_beside_it_is_mostly_of_the_lathe():
    """Most normals meet the axis; those of the block do not, and must not move it."""
    depth, normal, mask, true = solid(prism(180))
    rows, columns = np.indices(mask.shape)
    block = mask & (columns < np.flatnonzero(mask.any(0))[0] + 5) & (rows % 40 < 30)
    normal = np.where(block[..., None], [-0.6, 0, 0.8], normal)
    found = lathed(depth, normal, mask, CAMERA, up=UP)
    assert found is not None and not found.whole and found.misfit > 0.035
    offset = found.axis.foot - FOOT
    assert np.linalg.norm(offset - (offset @ UP) * UP) < 0.05
    assert np.abs(found.thickness - true)[mask].sum() < 0.15 * true[mask].sum()


def test_half_a_cylinder_is_none():
    """Its normals meet the axis; half a turn brings what is seen beside the mask."""
    depth, normal, mask, _ = solid(prism(180))
    half = mask & (np.arange(mask.shape[1]) < np.median(np.nonzero(mask)[1]))
    assert lathed(depth, normal, half, CAMERA, up=UP) is None
