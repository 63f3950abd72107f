"""Texels of environment maps: their directions and how much of the sphere they cover."""

import cv2
import numpy as np
from scipy.ndimage import gaussian_filter

from materialist.camera import pixel_rays, project, unit
from materialist.envmap import (
    environment,
    row_solid_angle,
    sh_basis,
    texel_directions,
    with_mirrored_photo,
)
from materialist.io.exr import read_exr
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


def test_the_mirrored_photo_has_no_colour():
    """A mirror must not show the colour of the thing that it was before."""
    photo = _checkered((96, 128)) * np.float32([1, 0.3, 0.1])
    photo[:, 64:] = photo[:, 64:, ::-1]
    envmap = np.full((64, 128, 3), 0.5, np.float32) * np.float32([1, 0.9, 0.8])
    light = with_mirrored_photo(envmap, photo, Camera(128, 96, 60.0))
    assert light.std() > 0.05
    np.testing.assert_allclose(light / light[..., :1], envmap / envmap[..., :1], rtol=1e-4)


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


def _fine(envmap: Array, where: Array) -> float:
    """RMS of the logarithm over its own surroundings, of 4 degrees."""
    log = np.log(envmap.mean(-1) + 0.05)
    difference = log - gaussian_filter(log, 6, mode=("nearest", "wrap"))
    return float(np.sqrt(np.square(difference[where]).mean()))


def test_captured_surroundings_have_detail_and_so_has_the_mirrored_photo(real_data):
    """Panoramas: a piece of each is the photo, and a blur of it stands for the fitted light.

    The true detail is 0.26 in the mean, a blur's 0.02, the mirrored photo's 0.09; it is not nearer to the truth.
    """
    camera = Camera(256, 192, 45.0)
    rays = unit(pixel_rays(camera)).reshape(-1, 3)
    direction = texel_directions(256, 512)
    azimuth = np.degrees(np.arctan2(direction[..., 0], -direction[..., 2]))
    unseen = (np.abs(azimuth) > 40) & (np.abs(direction[..., 1]) < 0.75)
    figures = []
    for path in sorted(real_data("data/envmaps").glob("*.exr"))[::4]:
        full = np.maximum(read_exr(path), 0).astype(np.float32)
        truth = cv2.resize(full, (512, 256), interpolation=cv2.INTER_AREA)
        photo = environment(rays, truth).reshape(192, 256, 3)
        truth = truth * (0.8 / np.percentile(photo, 90))
        photo = np.clip(photo * (0.8 / np.percentile(photo, 90)), 0, 1)
        fitted = np.stack(
            [gaussian_filter(truth[..., k], 16, mode=("nearest", "wrap")) for k in range(3)], -1
        )
        mirrored = with_mirrored_photo(fitted, photo, camera)
        where = unseen & (fitted.max(-1) < 1)

        def error(light: Array, truth: Array = truth, where: Array = where) -> float:
            ratio = np.log((light.mean(-1) + 0.05) / (truth.mean(-1) + 0.05))
            return float(np.sqrt(np.square(ratio[where]).mean()))

        detail = [_fine(light, where) for light in (truth, fitted, mirrored)]
        figures.append([*detail, error(fitted), error(mirrored)])
    true, blurred, detail_of_ours, error_before, error_after = np.mean(figures, 0)
    assert blurred < 0.15 * true
    assert 0.3 * true < detail_of_ours < true
    assert error_after < 1.1 * error_before
