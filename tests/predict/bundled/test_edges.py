"""Edge-aware medians."""

import cv2
import numpy as np

from materialist.predict.bundled.edges import GuidedFilter, weighted_median


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
