"""Surfaces behind an object: planes exactly, up to where they are seen to end."""

import numpy as np
from geometry_scenes import plane_depth

from materialist.edits.remove.behind import LOOSE, behind
from materialist.types import Camera

CAMERA = Camera(80, 60, 45.0)


def room():
    """Depth, normal and plane of a floor 0.4 below the camera and a wall at depth 4, which meet in a straight line."""
    floor = plane_depth(CAMERA, (0, 1, 0), -0.4)
    depth = np.minimum(floor, 4.0)
    plane = (floor >= 4).astype(int)
    normal = np.where(plane[..., None] == 1, [0.0, 0, 1], [0.0, 1, 0])
    return depth, normal, plane


def disc(row=38, column=40, radius=13):
    y, x = np.mgrid[:60, :80]
    return np.hypot(y - row, x - column) < radius


def test_floor_and_wall_go_on_and_meet_in_a_line():
    depth, normal, plane = room()
    hole = disc()
    assert (plane[hole] == 0).any() and (plane[hole] == 1).any()
    spoiled = np.where(hole, 1.5, depth)
    found = behind(spoiled, normal, np.where(hole, 0, plane), hole, np.where(hole, 1.5, 0), CAMERA)
    np.testing.assert_array_equal(found.depth[~hole], depth[~hole].astype(np.float32))
    wrong = hole & (found.label != plane)
    assert wrong.sum() < 0.04 * hole.sum()
    right = hole & ~wrong
    assert np.abs(found.depth / depth - 1)[right].max() < 0.01
    assert np.abs(found.normal - normal)[right].max() < 0.02


def test_a_table_goes_on_behind_things_that_stand_on_it():
    depth, normal, plane = room()
    plane = np.where(plane == 1, 0, plane)
    hole = disc(46, 40, 8)
    cup = disc(46, 55, 9) & ~hole
    depth = np.where(cup, 0.9, depth)
    plane = np.where(cup, LOOSE, plane)
    depth[:40] = np.minimum(depth[:40], 3.0)
    found = behind(np.where(hole, 0.8, depth), normal, plane, hole, np.where(hole, 0.8, 0), CAMERA)
    assert (found.label[hole] == 0).all()
