"""Normals of backs, and membranes: exact on planes, up to where they end and across holes."""

import numpy as np
from scipy.ndimage import binary_erosion

from materialist.camera import pixel_rays
from materialist.geometry.membrane import membrane
from materialist.geometry.slopes import back_normals
from materialist.types import Camera

CAMERA = Camera(64, 48, 40.0)
RAYS = pixel_rays(CAMERA).astype(float)
ROWS, COLUMNS = np.mgrid[:48, :64].astype(float)
DISC = np.hypot(ROWS - 24, COLUMNS - 32) < 15


def test_a_flat_slanting_back_has_one_normal_even_next_to_an_edge():
    """Two planes that meet in a column: right on either side of it, in perspective."""
    normals = [np.array([0.3, -0.4, -np.sqrt(0.75)]), np.array([-0.5, 0.1, -np.sqrt(0.74)])]
    left, right = (float(n @ [0, 0, -3]) / (RAYS @ n) for n in normals)
    first = left < right
    found = back_normals(np.minimum(left, right), DISC, RAYS)
    for own, normal in ((first, normals[0]), (~first, normals[1])):
        inner = binary_erosion(own, np.ones((5, 5))) & DISC
        assert inner.sum() > 100 and ((found[inner] @ normal) > 1 - 1e-6).all()
    assert (found[~DISC] == 0).all()


def test_linear_functions_are_carried_through_a_hole():
    y, x = np.mgrid[:60, :81].astype(float)
    truth = np.stack([2 * x - y, 0.3 * y + 5], -1)
    known = np.hypot(y - 30, x - 44) > 17
    found = membrane(np.where(known[..., None], truth, np.nan), known)
    np.testing.assert_array_equal(found[known], truth[known].astype(np.float32))
    assert np.abs(found - truth)[~known].max() < 0.04 * np.ptp(truth)
