"""The mirrored back of an object, against shapes whose thickness is known in closed form."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.solids.symmetry import border_distance, object_size, symmetric_thickness
from materialist.types import Camera


def ellipsoid(camera, centre, to_unit):
    """Depth, normal, mask and true thickness along the rays of |to_unit (x - centre)| = 1."""
    centre, to_unit = np.asarray(centre, float), np.asarray(to_unit, float)
    rays = pixel_rays(camera).astype(float)
    d, o = rays @ to_unit.T, -to_unit @ centre
    a, b, c = (d * d).sum(-1), d @ o, o @ o - 1
    mask = b * b > a * c
    root = np.sqrt(np.where(mask, b * b - a * c, 0))
    depth = np.where(mask, (-b - root) / a, 0)
    normal = (rays * depth[..., None] - centre) @ to_unit.T @ to_unit
    normal = np.where(mask[..., None], normal / np.linalg.norm(normal, axis=-1, keepdims=True), [0, 0, 1])
    return depth, normal, mask, np.where(mask, 2 * root / a * np.linalg.norm(rays, axis=-1), 0)


SHAPES = {
    "ball": ((0, 0, -3), np.eye(3), 0.03),
    "long": ((0.3, 0.2, -4), np.diag([1, 2, 0.9]), 0.15),
    "slanting": ((0, -0.4, -2.6), [[1, 0, 0], [0.3, 1.4, 0.5], [0, -0.6, 0.9]], 0.04),
}


@pytest.mark.parametrize("name", SHAPES)
def test_ellipsoids_are_mirrored_exactly_up_to_pixels(name):
    centre, to_unit, allowed = SHAPES[name]
    camera = Camera(128, 112, 45)
    depth, normal, mask, truth = ellipsoid(camera, centre, to_unit)
    found = symmetric_thickness(depth, normal, mask, camera)
    assert np.abs(found - truth)[mask].sum() < allowed * truth[mask].sum()
    assert (found[~mask] == 0).all()


def test_thickness_scales_with_the_scene():
    camera = Camera(64, 64, 40)
    depth, normal, mask, _ = ellipsoid(camera, (0, 0, -3), np.eye(3))
    one, seven = (symmetric_thickness(s * depth, normal, mask, camera) for s in (1, 7))
    np.testing.assert_allclose(seven, 7 * one, rtol=1e-4, atol=1e-5)


def test_a_plate_seen_face_on_is_neither_flat_nor_endless():
    camera = Camera(64, 64, 40)
    mask = np.zeros((64, 64), bool)
    mask[16:48, 20:44] = True
    depth, normal = np.full((64, 64), 2.0), np.tile([0.0, 0, 1], (64, 64, 1))
    found = symmetric_thickness(depth, normal, mask, camera)
    size = object_size(mask, depth, pixel_rays(camera))
    assert 0.05 * size < np.median(found[mask]) < size


def test_the_picture_border_is_no_silhouette():
    inside = np.zeros((20, 30), bool)
    inside[5:15, 20:] = True
    distance = border_distance(inside)
    assert distance[10, 29] == pytest.approx(4.5)
    assert distance[10, 20] == pytest.approx(0.5)


def test_bad_input_is_refused():
    camera = Camera(32, 32, 40)
    maps = np.ones((32, 32)), np.tile([0.0, 0, 1], (32, 32, 1))
    with pytest.raises(InputError, match="covers no surface"):
        symmetric_thickness(*maps, np.zeros((32, 32)), camera)
    with pytest.raises(InputError, match="camera needs"):
        symmetric_thickness(*maps, np.ones((32, 31)), camera)
    with pytest.raises(InputError, match="normals are"):
        symmetric_thickness(maps[0], maps[1][..., :2], np.ones((32, 32)), camera)
