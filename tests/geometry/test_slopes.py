"""Normals of backs: exact on planes, up to where they end."""

import numpy as np
from scipy.ndimage import binary_erosion

from materialist.camera import pixel_rays
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
