"""Texels of environment maps: their directions and how much of the sphere they cover."""

import numpy as np

from materialist.envmap import row_solid_angle, texel_directions


def test_texels_cover_the_sphere_once():
    for height in (4, 31, 256):
        assert np.isclose(row_solid_angle(height).sum() * 2 * height, 4 * np.pi)
    # Integrals of x^2, y^2, z^2 over the sphere are 4 pi / 3 each.
    square = (
        texel_directions(64, 128).astype(float) ** 2 * row_solid_angle(64)[:, None, None]
    ).sum((0, 1))
    np.testing.assert_allclose(square, 4 * np.pi / 3, rtol=1e-3)


def test_the_middle_looks_ahead_and_the_right_quarter_to_the_right():
    directions = texel_directions(65, 131)
    np.testing.assert_allclose(directions[32, 65], [0, 0, -1], atol=1e-6)
    np.testing.assert_allclose(texel_directions(64, 128)[32, 96], [1, 0, 0], atol=0.05)
    assert (directions[0, :, 1] > 0.99).all()
