"""Edges between pixels: a roof seen from outside, the same from within, and a step that is no edge."""

import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.geometry.ridges import at_edges, blurred_normals, edges
from materialist.types import Camera

CAMERA = Camera(48, 48, 30.0)
RAYS = pixel_rays(CAMERA).astype(float)
KNOWN = np.ones((48, 48), bool)
ROOF = np.array([[0.6, 0, 0.8], [-0.8, 0, 0.6]])
"""Its sides, towards the camera."""
TOP = np.array([0.013, 0, -3.0])


def planes(rays):
    """[..., 2] depth of both sides of the roof along rays."""
    return np.stack([(n @ TOP) / (rays @ n) for n in ROOF], -1)


def roof(rays, sign=1):
    """Depth and normals of the roof from outside (1), or of the back of a body that ends in it (-1)."""
    both = sign * planes(rays)
    side = both.argmax(-1)
    return np.abs(both.max(-1)), sign * ROOF[side]


def between(count=400, seed=0):
    """Places [N, 2] inside the picture, and the rays through them."""
    place = np.random.default_rng(seed).uniform(6, 41, (count, 2))
    place[:, 0] = np.random.default_rng(seed + 1).uniform(20, 28, count)  # near the ridge
    x, y = (place[:, 0] + 0.5 - 24) / CAMERA.focal, (24 - place[:, 1] - 0.5) / CAMERA.focal
    return place, np.stack([x, y, -np.ones(count)], -1)


@pytest.mark.parametrize("across", [0.013, 0.5 / CAMERA.focal * 3.0])  # between pixels, through their centres
@pytest.mark.parametrize("sign", [1, -1])
def test_places_beside_a_ridge_lie_on_the_side_that_is_there(sign, across, monkeypatch):
    monkeypatch.setattr(f"{__name__}.TOP", np.array([across, 0, -3.0]))
    depth, normal = roof(RAYS, sign)
    place, rays = between()
    found = at_edges(depth, normal, KNOWN, RAYS, place)
    true, facing = roof(rays[found.number], sign)
    assert len(found.number) == len(place)
    np.testing.assert_allclose(found.depth, true, rtol=1e-6)
    np.testing.assert_allclose(found.normal, facing, atol=1e-6)


def test_a_valley_is_the_nearer_plane():
    """A book that lies open: of two planes that rise to the sides the nearer one is seen."""
    sides = np.array([[0.6, 0, 0.8], [-0.6, 0, 0.8]])
    seen = lambda rays: np.stack([(n @ TOP) / (rays @ n) for n in sides], -1)  # noqa: E731
    depth, normal = seen(RAYS).min(-1), sides[seen(RAYS).argmin(-1)]
    place, rays = between()
    found = at_edges(depth, normal, KNOWN, RAYS, place)
    np.testing.assert_allclose(
        found.depth, seen(rays[found.number]).min(-1), rtol=5e-5
    )  # depth is not linear between pixels


def test_where_one_part_hides_another_nothing_is_said():
    """A tilted front part before a wall: their planes do not meet at the step."""
    depth, normal = np.full((48, 48), 5.0), np.tile([0, 0.0, 1], (48, 48, 1))
    depth[:, :24] = 3.0
    normal[:, :24] = [0.8, 0, 0.6]
    place, _ = between()
    found = at_edges(depth, normal, KNOWN, RAYS, place)
    beside = np.abs(place[:, 0] - 23.5) < 0.5
    assert not np.isin(found.number, np.flatnonzero(beside)).any()


def test_rough_normals_move_a_place_by_a_few_pixels_at_most():
    rng = np.random.default_rng(5)
    normal = np.array([0, 0, 1]) + rng.normal(0, 1.0, (48, 48, 3))
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    found = at_edges(np.full((48, 48), 3.0), normal, KNOWN, RAYS, between()[0])
    assert len(found.number) > 20
    assert np.abs(found.depth / 3 - 1).max() < 3.01 / CAMERA.focal
    assert np.isfinite(found.normal).all()


def test_a_pixel_without_a_normal_says_nothing():
    depth, normal = roof(RAYS)
    normal[20, 23] = 0
    found = at_edges(depth, normal, KNOWN, RAYS, between()[0])
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=-1), 1, atol=1e-6)


def test_what_has_no_edge_is_left_alone():
    depth, normal = np.full((48, 48), 3.0), np.tile([0, 0.0, 1], (48, 48, 1))
    assert not edges(normal, KNOWN).any()
    assert len(at_edges(depth, normal, KNOWN, RAYS, between()[0]).number) == 0


def test_the_blur_stays_on_its_side():
    rng = np.random.default_rng(3)
    _, normal = roof(RAYS)
    noisy = normal + rng.normal(0, 0.1, normal.shape)
    noisy /= np.linalg.norm(noisy, axis=-1, keepdims=True)
    found = blurred_normals(noisy, KNOWN, 2.0)
    angle = lambda a: np.degrees(np.arccos(np.clip((a * normal).sum(-1), -1, 1)))  # noqa: E731
    ridge = edges(normal, KNOWN)
    assert ridge.sum() == 2 * 48
    assert angle(noisy)[ridge].mean() > 6
    assert angle(found)[ridge].mean() < 3
    assert angle(found).max() < 8
    np.testing.assert_allclose(np.linalg.norm(found, axis=-1), 1, atol=1e-6)


def test_no_blur_leaves_normals_as_they_are():
    _, normal = roof(RAYS)
    np.testing.assert_allclose(blurred_normals(normal, KNOWN, 0.0), normal, atol=1e-12)
