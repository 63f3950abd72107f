"""Relative depths: the shift that normals reveal, and what happens without them."""

import numpy as np
import pytest

from materialist.predict.normals import normals_from_depth
from materialist.predict.relative import SETTINGS, from_relative
from materialist.types import Camera

CAMERA = Camera(96, 72, 50.0)
KINDS = [(True, lambda z: 3 / z + 0.7), (False, lambda z: 0.1 * z - 4)]
"""Whether the values are inverse depths, and values of a true depth."""


def room() -> np.ndarray:
    """[72, 96] depth of a floor that meets a wall, with a box on it."""
    inverse = np.maximum((np.arange(72)[:, None] + 0.5 - 20) / 52, 0.22) * np.ones((1, 96))
    inverse[30:60, 20:45] = np.maximum(inverse[30:60, 20:45], 0.75 + 0.004 * np.arange(25))
    return (1 / inverse).astype(np.float32)


@pytest.mark.parametrize(("inverse", "relative"), KINDS)
def test_normals_reveal_the_shift(inverse, relative):
    true = room()
    values, normal = relative(true).astype(np.float32), normals_from_depth(true, CAMERA)
    depth, ratio, fitted = from_relative(values, CAMERA, normal, inverse=inverse)
    assert fitted and ratio == pytest.approx(np.percentile(true, 99.5) / np.percentile(true, 0.5), rel=0.12)
    assert np.std(np.log(depth / true)) < 0.05


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_a_wall_that_faces_the_camera_may_be_most_of_the_picture(share):
    """Its normals are right at any ratio; the floor before it tells, however little of it is seen."""
    rows = np.arange(72)[:, None] + 0.5
    horizon, foot = 0.15 * 72, share * 72
    inverse = np.maximum(rows - horizon, foot - horizon) * np.ones((1, 96))
    true = (60 / inverse).astype(np.float32)
    ratio = from_relative((1 / true).astype(np.float32), CAMERA, normals_from_depth(true, CAMERA), inverse=True)[1]
    assert ratio == pytest.approx(np.percentile(true, 99.5) / np.percentile(true, 0.5), rel=0.12)


@pytest.mark.parametrize(("inverse", "relative"), KINDS)
def test_without_normals_the_ratio_is_the_documented_one(inverse, relative):
    for normal in (None, np.zeros((72, 96, 3), np.float32)):
        depth, ratio, fitted = from_relative(relative(room()), CAMERA, normal, inverse=inverse)
        assert ratio == SETTINGS.ratio and not fitted and depth.dtype == np.float32
        near, far = np.percentile(depth, (0.5, 99.5))
        assert (near, far) == (pytest.approx(1, rel=1e-3), pytest.approx(SETTINGS.ratio, rel=1e-3))
        assert (np.diff(depth[40:, 5]) <= 0).all()  # the floor comes nearer downwards
