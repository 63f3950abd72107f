"""ClickNet: what it sees, where it looks, and that the weights that ship find things."""

import numpy as np
import pytest
import torch

from materialist.camera import pixel_rays
from materialist.errors import InputError
from materialist.predict.clicks.features import BOX, CHANNELS, NORMAL_X, SPOT, click_features
from materialist.predict.clicks.network import ClickNet
from materialist.predict.clicks.segment import object_likelihood
from materialist.predict.network import UNetArchitecture
from materialist.types import Camera

SMALL = UNetArchitecture((8, 8, 8, 8, 8), (1, 1, 1, 1, 1))
DISTANCE = 13
COSINE = 11
COLOUR = slice(8, 11)


def scene(size=(120, 160), at=(80, 66), radius=30):
    """A red ball on a grey floor, seen from above: photo, and the ball's mask."""
    camera = Camera(size[1], size[0], 45.0)
    rays = pixel_rays(camera).astype(float)
    floor = np.array([0.0, 0.6, 0.8])
    depth = -2.0 / np.minimum(rays @ floor, -1e-3)
    y, x = np.mgrid[: size[0], : size[1]]
    u = (x - at[0]) / radius
    v = (y - at[1]) / radius
    ball = u**2 + v**2 < 1
    bulge = np.sqrt(np.clip(1 - u**2 - v**2, 0, 1))
    normal = np.where(ball[..., None], np.stack([u, -v, bulge], -1), floor)
    middle = depth[at[1], at[0]]
    depth = np.where(ball, middle * (0.92 - 0.12 * bulge), depth)
    shade = (normal @ np.array([0.3, 0.8, 0.5])).clip(0.15)
    rgb = np.where(ball[..., None], [0.75, 0.2, 0.15], [0.55, 0.55, 0.52]) * shade[..., None] ** 0.5
    rgb = rgb + np.random.default_rng(0).normal(0, 0.01, rgb.shape)
    return (
        rgb.clip(0, 1).astype(np.float32),
        normal.astype(np.float32),
        depth.astype(np.float32),
    ), ball


@pytest.fixture(scope="module")
def untrained(tmp_path_factory):
    torch.manual_seed(0)
    network = ClickNet(SMALL)
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, 0, 0.1)
    path = tmp_path_factory.mktemp("weights") / "w.safetensors"
    network.save(path, {"step": 7})
    return path


def test_features_have_closed_forms():
    photo, _ = scene()
    maps = click_features(*photo, [(80, 66)])
    assert maps.shape == (CHANNELS, 120, 160) and maps.dtype == np.float32
    y, x = np.indices((120, 160))
    np.testing.assert_allclose(maps[DISTANCE], np.hypot(x - 80, y - 66) / 160, atol=1e-6)
    assert maps[SPOT, 66, 80] == 1 and maps[SPOT, 66, 90] < 0.01
    np.testing.assert_allclose(maps[:3], np.moveaxis(photo[0], -1, 0) - 0.5, atol=1e-6)
    assert maps[COLOUR, 66, 80].max() < 0.03 < maps[COLOUR, 110, 20].max()
    assert maps[COSINE, 66, 80] > 0.99


def test_a_box_stands_for_a_click_in_its_middle():
    photo, _ = scene()
    maps = click_features(*photo, box=(60, 40, 101, 91))
    rows, columns = np.nonzero(maps[BOX])
    assert (columns.min(), rows.min(), columns.max(), rows.max()) == (60, 40, 100, 90)
    assert maps[BOX].sum() == 41 * 51 and not maps[SPOT].any() and maps[DISTANCE, 65, 80] == 0
    inner = np.median(photo[0][52:79, 70:91].reshape(-1, 3), 0)
    np.testing.assert_allclose(
        maps[COLOUR], np.moveaxis(np.abs(photo[0] - inner), -1, 0), atol=1e-6
    )
    assert not click_features(*photo, [(80, 66)])[BOX].any()


def test_a_mirrored_photo_has_mirrored_features():
    (rgb, normal, depth), _ = scene()
    other = rgb[:, ::-1], normal[:, ::-1] * [-1, 1, 1], depth[:, ::-1]
    there = click_features(*other, [(159 - 70, 50)])[..., ::-1].copy()
    there[NORMAL_X] *= -1
    np.testing.assert_allclose(there, click_features(rgb, normal, depth, [(70, 50)]), atol=1e-6)


@pytest.mark.parametrize("size", [(40, 300), (9, 9)])
def test_photos_of_any_shape(untrained, size):
    rng = np.random.default_rng(0)
    photo = [rng.random((*size, *more), np.float32) for more in ((3,), (3,), ())]
    assert (
        object_likelihood(*photo, [(size[1] - 1, 0), (0, size[0] - 1)], weights=untrained).shape
        == size
    )


@pytest.mark.parametrize("clicks", [[], [(160, 3)]])
def test_places_outside_are_errors(untrained, clicks):
    with pytest.raises(InputError, match="inside 160 x 120 pixels"):
        object_likelihood(*scene()[0], clicks, weights=untrained)


def test_the_number_of_threads_changes_no_bit(untrained):
    photo, _ = scene()
    before = torch.get_num_threads()
    likelihoods = []
    try:
        for threads in (1, 3):
            torch.set_num_threads(threads)
            likelihoods.append(object_likelihood(*photo, [(80, 66)]))
            assert torch.get_num_threads() == threads
    finally:
        torch.set_num_threads(before)
    np.testing.assert_array_equal(*likelihoods)


@pytest.mark.parametrize("click", [(80, 66), (92, 80)])
def test_the_weights_that_ship_find_a_ball(click):
    photo, ball = scene()
    found = object_likelihood(*photo, [click]) > 0.5
    assert (found & ball).sum() / (found | ball).sum() > 0.6
