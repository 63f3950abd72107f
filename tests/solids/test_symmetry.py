"""The mirrored back of an object, against ellipsoids, whose thickness is known in closed form."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.geometry.silhouette import object_size
from materialist.solids.symmetry import symmetric_thickness
from materialist.types import Camera

CAMERA = Camera(128, 112, 45)


def ellipsoid(centre, to_unit):
    """Depth, normal, mask and true thickness along the rays of |to_unit (x - centre)| = 1."""
    centre = np.asarray(centre, float)
    to_unit = np.asarray(to_unit, float)
    rays = pixel_rays(CAMERA).astype(float)
    d = rays @ to_unit.T
    o = -to_unit @ centre
    a = (d * d).sum(-1)
    b = d @ o
    c = o @ o - 1
    mask = b * b > a * c
    root = np.sqrt(np.where(mask, b * b - a * c, 0))
    depth = np.where(mask, (-b - root) / a, 0)
    normal = (rays * depth[..., None] - centre) @ to_unit.T @ to_unit
    normal = np.where(
        mask[..., None], normal / np.linalg.norm(normal, axis=-1, keepdims=True), [0, 0, 1]
    )
    return depth, normal, mask, np.where(mask, 2 * root / a * np.linalg.norm(rays, axis=-1), 0)


@pytest.mark.parametrize(
    ("centre", "to_unit", "allowed"),
    [
        ((0, 0, -3), np.eye(3), 0.03),
        ((0.3, 0.2, -4), np.diag([1, 2, 0.9]), 0.15),
        ((0, -0.4, -2.6), [[1, 0, 0], [0.3, 1.4, 0.5], [0, -0.6, 0.9]], 0.04),
    ],
)
def test_ellipsoids_are_mirrored_exactly_up_to_pixels_at_any_scale(centre, to_unit, allowed):
    depth, normal, mask, truth = ellipsoid(centre, to_unit)
    found = symmetric_thickness(depth, normal, mask, CAMERA)
    assert np.abs(found - truth)[mask].sum() < allowed * truth[mask].sum()
    assert (found[~mask] == 0).all()
    np.testing.assert_allclose(
        symmetric_thickness(7 * depth, normal, mask, CAMERA), 7 * found, rtol=1e-4, atol=1e-5
    )


def test_a_plate_seen_face_on_is_neither_flat_nor_endless():
    camera = Camera(64, 64, 40)
    mask = np.zeros((64, 64), bool)
    mask[16:48, 20:44] = True
    depth = np.full((64, 64), 2.0)
    normal = np.tile([0.0, 0, 1], (64, 64, 1))
    found = symmetric_thickness(depth, normal, mask, camera)
    size = object_size(mask, depth, pixel_rays(camera))
    assert 0.05 * size < np.median(found[mask]) < size
