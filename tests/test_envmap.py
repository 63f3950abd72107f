"""Texels of environment maps: their directions and how much of the sphere they cover."""

import numpy as np

from materialist.camera import project
from materialist.envmap import row_solid_angle, sh_basis, texel_directions, with_mirrored_photo
from materialist.types import Array, Camera


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


def _checkered(shape: tuple[int, int]) -> Array:
    """[H, W, 3] a photo of 16 x 16 squares, black and white."""
    rows, columns = np.indices(shape)
    return np.repeat((((rows // 16 + columns // 16) % 2)[..., None]).astype(np.float32), 3, -1)


def test_the_mirrored_photo_gives_detail_and_leaves_the_light_on_diffuse_surfaces():
    camera = Camera(128, 96, 60.0)
    envmap = np.full((64, 128, 3), 0.5, np.float32)
    with_detail = with_mirrored_photo(envmap, _checkered((96, 128)), camera)
    around = np.abs(texel_directions(64, 128)[..., 2]) < 0.7
    assert with_detail[around].std() > 0.1
    basis = sh_basis(texel_directions(64, 128).reshape(-1, 3).astype(float), 2)
    weight = np.repeat(row_solid_angle(64), 128)[:, None]

    def moments(light: Array) -> Array:
        return (basis * weight).T @ light.reshape(-1, 3)

    before = moments(envmap)
    error = np.linalg.norm(moments(with_detail) - before) / np.linalg.norm(before)
    assert error < 0.02


def test_the_mirrored_photo_leaves_what_is_in_the_frame_and_lamps():
    camera = Camera(128, 96, 60.0)
    envmap = np.full((64, 128, 3), 0.5, np.float32)
    envmap[20:24, 100:110] = 30.0
    with_detail = with_mirrored_photo(envmap, _checkered((96, 128)), camera)
    place, ahead = project(texel_directions(64, 128), camera)
    frame = (ahead > 0) & ((place >= 0) & (place < [128, 96])).all(-1)
    np.testing.assert_array_equal(with_detail[frame], envmap[frame])
    np.testing.assert_array_equal(with_detail[20:24, 100:110], 30.0)


def test_the_mirrored_photo_starts_at_both_edges_of_the_frame_and_meets_itself_behind():
    """A photo that is bright in its right third: so is the right half of the map, and its left one is not."""
    camera = Camera(120, 90, 60.0)
    photo = np.full((90, 120, 3), 0.2, np.float32)
    photo[:, 88:92] = 0.8  # a bright line three quarters to the right
    detail = with_mirrored_photo(np.ones((90, 180, 3), np.float32) * 0.5, photo, camera)
    row = detail[45, :, 0]
    azimuth = np.degrees(
        np.arctan2(*np.moveaxis(texel_directions(90, 180)[45, :, ::2], -1, 0) * [[1], [-1]])
    )
    # 75 % of the way from the left edge is half of the way from the right edge to straight behind.
    assert abs(azimuth[row.argmax()] - (30 + 150 * 0.5)) < 4
    assert abs(row[0] - row[-1]) < 0.05
