"""Planes fitted to windows: exact on planes, up to where they end, and near the truth on a ball."""

import numpy as np

from materialist.camera import pixel_rays
from materialist.geometry.tangents import back_normals, continued, sampled, slopes_of
from materialist.types import Camera

RAYS = pixel_rays(Camera(64, 48, 40.0)).astype(float)
ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)
DISC = np.hypot(ROWS - 24, COLUMNS - 32) < 15


def test_slopes_of_a_plane_are_exact_up_to_its_border():
    plane = 3 + 0.2 * COLUMNS - 0.05 * ROWS
    for sigma in (0.5, 2.0):
        right, down = slopes_of(np.where(DISC, plane, 99), DISC, sigma)
        np.testing.assert_allclose(right[DISC], 0.2, atol=1e-4)
        np.testing.assert_allclose(down[DISC], -0.05, atol=1e-4)


def test_one_pixel_alone_is_level():
    alone = np.zeros((48, 64), bool)
    alone[10, 10] = True
    right, down = slopes_of(ROWS, alone)
    assert abs(right[10, 10]) < 1e-9 and abs(down[10, 10]) < 1e-9
    assert (continued(ROWS, alone) == 10).all()


def test_a_plane_is_carried_on():
    plane = 3 + 0.2 * COLUMNS - 0.05 * ROWS
    found = continued(np.where(DISC, plane, 99), DISC)
    near = np.hypot(ROWS - 24, COLUMNS - 32) < 16
    np.testing.assert_allclose(found[near], plane[near], atol=1e-3)


def test_a_flat_slanting_back_has_one_normal_even_next_to_an_edge():
    """Two planes that meet in a column: right on either side of it, in perspective."""
    normals = [np.array([0.3, -0.4, -np.sqrt(0.75)]), np.array([-0.5, 0.1, -np.sqrt(0.74)])]
    left, right = (float(n @ [0, 0, -3]) / (RAYS @ n) for n in normals)
    first = left < right
    found = back_normals(np.minimum(left, right), DISC, RAYS)
    from scipy.ndimage import binary_erosion

    for own, normal in ((first, normals[0]), (~first, normals[1])):
        inner = binary_erosion(own, np.ones((5, 5))) & DISC
        assert inner.sum() > 100
        assert ((found[inner] @ normal) > 1 - 1e-6).all()
    assert (found[~DISC] == 0).all()


def test_the_back_of_a_ball():
    centre = np.array([0, 0, -3.0])
    a, b = (RAYS**2).sum(-1), RAYS @ centre
    root = b * b - a * (9 - 0.36)
    inside = root > 0
    depth = (b + np.sqrt(np.maximum(root, 0))) / a
    true = (RAYS * depth[..., None] - centre) / 0.6
    found = back_normals(depth, inside, RAYS)
    cosine = (found * true).sum(-1)[inside]
    assert np.median(cosine) > 0.9999 and np.quantile(cosine, 0.1) > 0.99


def test_maps_are_read_between_pixels():
    place = np.array([[23.5, 17.25], [40, 30]])
    np.testing.assert_allclose(sampled(np.stack([COLUMNS, ROWS], -1), place), place, atol=3e-3)
    np.testing.assert_allclose(sampled(ROWS, place, order=1), place[:, 1])
