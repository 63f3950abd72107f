"""Filling by MI-GAN: surfaces go on through the hole, and nothing is guessed from what may not be seen."""

import cv2
import numpy as np
import pytest

from materialist.color import linear_to_srgb
from materialist.edits.remove import filling
from materialist.edits.remove.filling import NotFilled, filled, remembered, remembered_alone


def hole_in(shape, top=24, left=30, height=20, width=24):
    hole = np.zeros(shape, bool)
    hole[top : top + height, left : left + width] = True
    return hole


def two_walls(height=96, width=128):
    """A picture [H, W, 3] of two rough surfaces that meet along a slanting edge, and where the lower one is."""
    rows, columns = np.indices((height, width))
    below = rows > 0.48 * height - columns / 8
    rough = np.random.default_rng(0).uniform(0.85, 1.15, (height, width, 1))
    return np.where(below[..., None], [0.5, 0.2, 0.1], [0.3, 0.4, 0.6]) * rough, below


def without(picture, hole):
    """The picture, spoiled in the hole."""
    return np.where(hole[..., None], 0.9, picture)


@pytest.fixture
def blurred(monkeypatch):
    """In place of the network, which takes seconds: a picture blurred so far that all of it shows in the hole."""

    def network(path, inputs):
        picture = np.moveaxis(inputs["image"][0], 0, -1)
        return [np.moveaxis(cv2.blur(picture, (401, 401)), -1, 0)[None]]

    monkeypatch.setattr(filling, "run", network)


def test_a_slanting_edge_crosses_the_hole(one_answer):
    picture, below = two_walls()
    rows, columns = np.indices(below.shape)
    hole = np.hypot(rows - 40, columns - 64) < 16
    guess = filled(without(picture, hole), hole, ~hole)
    np.testing.assert_array_equal(guess[~hole], picture[~hole].astype(np.float32))
    assert ((guess[..., 0] > guess[..., 2]) != below)[hole].mean() < 0.1
    assert np.abs(guess - picture)[hole].mean() < 0.1


def test_the_answer_on_which_mirror_images_agree_is_taken(monkeypatch):
    """The network of this test puts a bright spot in the hole of the first picture that it sees."""
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    seen = []

    def network(path, inputs):
        answer = inputs["image"].copy()
        row, column = (int(np.mean(places)) for places in np.nonzero(inputs["mask"][0, 0] == 0))
        answer[0, :, inputs["mask"][0, 0] == 0] = 100 + 4 * len(seen)
        if not seen:
            answer[0, :, row - 20 : row + 20, column - 20 : column + 20] = 255
        seen.append(inputs["image"])
        return [answer]

    monkeypatch.setattr(filling, "run", network)
    guess = filled(without(picture, hole), hole, ~hole)
    (level,) = np.unique(np.round(255 * linear_to_srgb(guess[hole])))
    assert level in (104, 108, 112)
    # What it sees are the four mirror images.
    assert len(seen) == 4
    for other, axes in zip(seen[1:], (1, 2, (1, 2)), strict=True):
        np.testing.assert_array_equal(np.flip(other[0], axes), seen[0][0])


def test_what_may_not_be_seen_changes_nothing(blurred):
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    usable = ~hole & (np.arange(128) < 58)
    other = np.where(np.arange(128)[:, None] < 58, picture, [0.9, 0.1, 0.1])
    one, two = (filled(without(p, hole), hole, usable) for p in (picture, other))
    np.testing.assert_array_equal(one[hole], two[hole])
    from_all = filled(without(picture, hole), hole, ~hole)
    assert np.abs(one - from_all)[hole].max() > 0.01


def test_hdr_values_stay(one_answer):
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    guess = filled(without(40 * picture, hole), hole, ~hole)
    assert np.abs(np.log(guess / (40 * picture)))[hole].mean() < 0.5


def test_what_is_taken_away_does_not_change_the_filling(blurred):
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    dim, bright = (
        filled(np.where(hole[..., None], value, picture), hole, ~hole) for value in (0.9, 1e4)
    )
    np.testing.assert_array_equal(bright[hole], dim[hole])


def test_blown_whites_of_a_large_photo_are_no_hdr(monkeypatch):
    # The area mean of this size is above 1 by rounding.
    photo = np.ones((1080, 1920, 3), np.float32)
    hole = hole_in((540, 960))
    seen = []
    monkeypatch.setattr(filling, "_inpainted", lambda levels, _: seen.append(levels) or levels)
    photo[500:] = 0.2
    filled(photo, hole, ~hole)
    assert seen[0][-1, -1, 0] == round(255 * float(linear_to_srgb(np.float32(0.2))))


@pytest.mark.parametrize(
    "place", [np.s_[:, 1:], pytest.param(np.s_[:1, :1], marks=pytest.mark.slow)]
)
def test_holes_of_any_shape(place, one_answer):
    picture, _ = two_walls(72, 96)
    hole = np.zeros((72, 96), bool)
    hole[place] = True
    guess = filled(without(picture, hole), hole, ~hole)
    assert np.isfinite(guess).all() and guess.min() >= 0


def test_a_lamp_leaves_the_dark_its_levels(monkeypatch):
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    lamp = 0.1 * picture
    lamp[80:90, 100:110] = 500
    seen = []
    monkeypatch.setattr(filling, "_inpainted", lambda levels, _: seen.append(levels) or levels)
    guess = filled(lamp, hole, ~hole)
    assert (guess[80:90, 100:110] == 500).all()
    few = np.round(255 * filling._encoded(lamp[:70], 500)).astype(np.uint8)
    assert len(np.unique(seen[0][:70])) > 2 * len(np.unique(few))


@pytest.mark.parametrize(
    "size",
    [
        (9, 9),
        pytest.param((400, 1), marks=pytest.mark.slow),
        pytest.param((700, 20), marks=pytest.mark.slow),
        pytest.param((1, 1500), marks=pytest.mark.slow),
    ],
)
def test_photos_of_any_shape(size, one_answer):
    hole = np.zeros(size, bool)
    hole[3:6, 4:7] = True
    hole[size[0] // 2, size[1] // 2] = True
    guess = filled(np.full((*size, 3), 0.4), hole, ~hole)
    scale = min(1, filling.SETTINGS.max_side / max(size))
    assert guess.shape == (*(max(1, round(n * scale)) for n in size), 3)
    assert np.abs(guess - 0.4).max() < 0.3


def test_a_large_photo_is_filled_at_a_smaller_size(filled_smoothly):
    photo = np.full((30, 2048, 3), 0.3, np.float32)
    hole = hole_in((15, 1024), top=4, left=500, height=6)
    assert filled(photo, hole, ~hole).shape == (15, 1024, 3)


def test_a_filling_is_remembered(tmp_path, monkeypatch):
    monkeypatch.setattr(filling, "_inpainted", lambda levels, _: 255 - levels)
    picture, _ = two_walls()
    hole = hole_in(picture.shape[:2])
    with remembered(tmp_path):
        with remembered_alone(), pytest.raises(NotFilled):
            filled(picture, hole, ~hole)
        once = filled(picture, hole, ~hole)
        with remembered_alone():
            np.testing.assert_array_equal(filled(picture, hole, ~hole), once)
