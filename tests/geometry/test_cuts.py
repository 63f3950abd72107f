"""Occlusion cuts: where the grid parts, and where it must not."""

import numpy as np
import pytest
from geometry_scenes import plane_depth, sphere_depth
from scipy import ndimage

from materialist.geometry.cuts import find_cuts
from materialist.types import Camera

CAMERA = Camera(96, 64, 50.0)


@pytest.mark.parametrize("tau", [1.0, 6.0, 12.0])
def test_a_floor_seen_down_to_the_horizon_is_whole(tau):
    # A floor 1 below the camera, level, seen from 22 degrees below the horizon up to a third of a pixel below it.
    depth = plane_depth(CAMERA, (0.003, 1, -0.002), -1.0)
    depth = np.where(depth < 1e4, depth, 0)
    assert (depth > 200).any()  # below a degree
    cuts = find_cuts(depth, CAMERA, tau)
    assert not cuts.cut_x.any() and not cuts.cut_y.any()


@pytest.mark.parametrize("degrees", [3.0, 1.0])
@pytest.mark.parametrize("turn", [0.0, 30.0, 90.0])
def test_a_plane_at_grazing_angle_is_whole(degrees, turn):
    camera = Camera(64, 48, 3.0)  # a narrow view, so that the angle is nearly the same everywhere
    tilt = np.radians(90 - degrees)
    spin = np.radians(turn)
    normal = np.array([np.sin(tilt) * np.cos(spin), np.sin(tilt) * np.sin(spin), np.cos(tilt)])
    depth = plane_depth(camera, normal, normal @ [0, 0, -10])
    depth = np.where((depth > 2) & (depth < 100), depth, 0)
    cuts = find_cuts(depth, camera, 6.0)
    assert cuts.link_x.sum() > 500
    assert not cuts.cut_x.any() and not cuts.cut_y.any()


@pytest.mark.parametrize("tau", [30.0, 60.0, 85.0])
def test_a_plane_with_its_normals_is_whole_by_any_tau(tau):
    camera = Camera(64, 48, 40.0)
    for normal in ([-1.0, 0.0, 1.0], [0.0, 0.0, 1.0]):
        normal = np.array(normal) / np.linalg.norm(normal)
        depth = plane_depth(camera, normal, -4.0)
        cuts = find_cuts(depth, camera, tau, np.broadcast_to(normal, (*depth.shape, 3)))
        assert not cuts.cut_x.any()
        assert not cuts.cut_y.any()


@pytest.mark.parametrize(("pixels", "shift"), [(6, 0.13), (12, 0.0), (45, 0.37)])
def test_a_sphere_is_cut_off_all_round_but_not_cracked(pixels, shift):
    camera = Camera(100, 100, 40.0)
    distance = 10.0
    radius = pixels * distance / camera.focal
    sphere, _ = sphere_depth(camera, (shift * distance / camera.focal, 0.05, -distance), radius)
    depth = np.minimum(sphere, 40.0)
    ball = np.isfinite(sphere)
    cuts = find_cuts(depth, camera, 6.0)
    rim_x = ball[:, :-1] != ball[:, 1:]
    rim_y = ball[:-1] != ball[1:]
    np.testing.assert_array_equal(cuts.cut_x, rim_x)
    np.testing.assert_array_equal(cuts.cut_y, rim_y)


@pytest.mark.parametrize("tau", [1.0, 6.0, 8.0, 12.0])
def test_the_criterion_switches_at_tau(tau):
    # One step across the middle of the picture: the ray runs along -Z there, so the angle has a closed form.
    camera = Camera(40, 30, 5.0)
    near = 5.0
    for factor, cut in ((0.9, True), (1.1, False)):
        # The pair spans half a pixel at depth `near` and half a pixel at `near + step`:
        # tan(angle) = (near + step / 2) / focal / step.
        step = near / (camera.focal * np.tan(np.radians(tau * factor)) - 0.5)
        depth = np.full((30, 40), near)
        depth[:, 20:] = near + step
        cuts = find_cuts(depth, camera, tau)
        assert cuts.cut_x[15, 19] == cut
        assert cuts.cut_x.sum() == (30 if cut else 0) and not cuts.cut_y.any()


@pytest.mark.parametrize("width", [1, 3, 7])
@pytest.mark.parametrize("tau", [1.0, 12.0])
def test_smeared_edges_part_when_the_normals_say_that_nothing_is_slanted(width, tau):
    # docs/geometry.md, "Resolution limit"
    camera = Camera(256, 16, 18.0)
    inverse = np.full((16, 256), 1 / 4)
    inverse[:, 120 : 120 + width] = 1 / 2
    facing = np.zeros((16, 256, 3))
    sideways = np.zeros((16, 256, 3))
    facing[..., 2], sideways[..., 0] = 1, 1
    for smear in (1, 3, 7):
        smeared = ndimage.uniform_filter1d(inverse, smear, axis=1)
        step = np.abs(np.diff(smeared[8]))
        cut = find_cuts(1 / smeared, camera, tau, facing).cut_x[8]
        np.testing.assert_array_equal(cut, step > 1e-9)
        upright = find_cuts(1 / smeared.T, Camera(16, 256, 1.13), tau, facing.transpose(1, 0, 2))
        np.testing.assert_array_equal(upright.cut_y[:, 8], step > 1e-9)
        if smear == 7 and width >= 7:  # by depth alone, this is a slanted surface
            for normal in (None, sideways):
                assert not find_cuts(1 / smeared, camera, tau, normal).cut_x.any()
