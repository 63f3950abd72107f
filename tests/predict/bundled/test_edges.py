"""Edge-aware medians, and depth joined with the normals: their slopes in the small, sharp edges in the large."""

import cv2
import numpy as np
import pytest

from materialist.camera import pixel_rays
from materialist.predict.bundled.edges import (
    GuidedFilter,
    demanded_slopes,
    least_squares_change,
    weighted_median,
    with_relief,
)
from materialist.types import Camera

CAMERA = Camera(64, 48, 50.0)
RAYS = pixel_rays(CAMERA)[..., :2].copy()  # [48, 64, 2]


def two_sides(height=24, width=32, noise=0.01):
    """A photo of two colours with a slanted border, and which side each pixel is on."""
    rows, columns = np.mgrid[:height, :width]
    side = columns + 0.3 * rows > width * 0.6
    rng = np.random.default_rng(2)
    photo = np.where(
        side[..., None], [0.8, 0.3, 0.1], [0.3, 0.4, 0.6]
    ) + noise * rng.standard_normal((height, width, 3))
    return photo.astype(np.float32), side


def written_out(photo, members, radius, eps):
    """Sum over windows k that hold i and over j in k, away from the border of the picture."""
    height, width = photo.shape[:2]
    count = (2 * radius + 1) ** 2
    out = np.full((height, width), np.nan)

    def window(r, c):
        return (slice(r - radius, r + radius + 1), slice(c - radius, c + radius + 1))

    for r in range(2 * radius, height - 2 * radius):
        for c in range(2 * radius, width - 2 * radius):
            total = 0.0
            for kr in range(r - radius, r + radius + 1):
                for kc in range(c - radius, c + radius + 1):
                    colours = photo[window(kr, kc)].reshape(-1, 3).astype(np.float64)
                    mean = colours.mean(0)
                    inverse = np.linalg.inv(
                        (colours - mean).T @ (colours - mean) / count + eps * np.eye(3)
                    )
                    weight = 1 + (colours - mean) @ inverse @ (photo[r, c] - mean)
                    total += (weight * members[window(kr, kc)].ravel()).sum() / count**2
            out[r, c] = total
    return out


def test_shares_are_the_weights_of_the_guided_filter():
    photo, side = two_sides(12, 14, noise=0.05)
    members = (side * np.random.default_rng(1).random(side.shape)).astype(np.float32)
    expected = written_out(photo, members, 2, 1e-3)
    known = np.isfinite(expected)
    assert known.sum() == 4 * 6
    np.testing.assert_allclose(
        GuidedFilter(photo, radius=2, eps=1e-3).share(members)[known], expected[known], atol=2e-4
    )


def test_a_blurred_outline_becomes_the_photos():
    photo, side = two_sides(64, 80)
    true = np.where(side, 1.0, 2.0).astype(np.float32)
    blurred = cv2.GaussianBlur(true, (0, 0), 4)
    sharp = weighted_median(blurred, GuidedFilter(photo, radius=12), np.ones_like(side))
    near = np.abs(cv2.GaussianBlur(side.astype(np.float32), (0, 0), 2) - 0.5) < 0.45
    assert np.abs(sharp - true)[near].mean() < 0.35 * np.abs(blurred - true)[near].mean()


def _plane(normal, offset):
    """log depth [H, W] and normals [H, W, 3] of the plane n . x = -offset before the camera."""
    normal = np.array(normal) / np.linalg.norm(normal)
    directions = np.concatenate([RAYS, -np.ones((*RAYS.shape[:2], 1))], -1)
    depth = -offset / (directions @ normal)
    return np.log(depth).astype(np.float32), np.broadcast_to(normal, directions.shape).astype(
        np.float32
    )


@pytest.mark.parametrize("normal", [(0.1, 0.2, 1), (0, 1, 0.7), (0.8, 0, 0.6)])
def test_texture_printed_onto_a_plane_is_gone(normal):
    true, normals = _plane(normal, 1.5)
    assert np.isfinite(true).all()
    printed = true + np.random.default_rng(0).choice([-0.005, 0, 0.005], true.shape).astype(
        np.float32
    )
    found = with_relief(printed, normals, RAYS)
    assert np.abs(found - true).max() < 2e-3


def test_an_edge_stays_where_it_is_sharp():
    far, normals = _plane((0, 0, 1), 3.0)
    sharp = far.copy()
    sharp[10:40, 20:40] -= 0.5
    np.testing.assert_allclose(with_relief(sharp, normals, RAYS), sharp, atol=0.05)


def test_a_steep_side_that_the_depth_flattens_has_no_steps():
    """Normals that ask for more slope than the depth has mark no border of two surfaces: the side stays smooth."""
    true, normals = _plane((1, 0, 0.7), 3.0)
    rng = np.random.default_rng(0)
    flat = 0.4 * true + 0.004 * rng.standard_normal(true.shape).astype(np.float32)
    slope = np.diff(with_relief(flat, normals, RAYS), axis=1)
    asked = np.diff(true, axis=1)
    assert (np.abs(asked) > 0.015).any()
    assert np.abs(slope - asked).max() < 0.6 * np.abs(asked).max()
    assert np.abs(np.diff(slope, axis=1)).max() < 0.01


def test_a_plane_has_the_slopes_of_its_depth():
    rays = pixel_rays(Camera(160, 120, 40.0))
    normal = np.array([0.3, -0.2, 0.9]) / np.linalg.norm([0.3, -0.2, 0.9])
    log_depth = np.log(-2.0 / (rays @ normal))
    across, down = demanded_slopes(np.broadcast_to(normal, rays.shape), rays)
    assert np.abs((across[:, 1:] + across[:, :-1]) / 2 - np.diff(log_depth, axis=1)).max() < 1e-6
    assert np.abs((down[1:] + down[:-1]) / 2 - np.diff(log_depth, axis=0)).max() < 1e-6
    away = np.broadcast_to(np.array([1.0, 0, 0]), rays.shape)
    assert np.isfinite(demanded_slopes(away, rays)).all()  # grazing


def test_the_change_solves_the_dense_least_squares_problem():
    rng = np.random.default_rng(0)
    count = 12
    first = np.r_[np.arange(11), 0, 3]
    second = np.r_[np.arange(1, 12), 7, 11]
    wanted = rng.normal(size=13)
    weight = rng.uniform(0.01, 2, 13)
    pull = rng.uniform(0.1, 1, count)
    found = least_squares_change(first, second, wanted, weight, pull, rtol=1e-12, maxiter=200)
    rows = np.zeros((13, count))
    rows[np.arange(13), first], rows[np.arange(13), second] = -1, 1
    system = np.r_[np.sqrt(weight)[:, None] * rows, np.diag(np.sqrt(pull))]
    expected = np.linalg.lstsq(
        system, np.r_[np.sqrt(weight) * wanted, np.zeros(count)], rcond=None
    )[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)
