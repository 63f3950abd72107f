"""The border of a mask at the photo's own size: where it runs, its mixed pixels, and the colours of both sides."""

import cv2
import numpy as np
import pytest

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.composite.matte import matte, unmixed


def test_matte_finds_the_share_of_mixed_pixels():
    front = np.array([0.9, 0.4, 0.1])
    back = np.array([0.1, 0.3, 0.6])
    share = np.clip((30.5 - np.arange(60)) / 6 + 0.5, 0, 1)  # a border six native pixels wide
    encoded = share[:, None] * linear_to_srgb(front) + (1 - share[:, None]) * linear_to_srgb(back)
    large = np.repeat(srgb_to_linear(encoded)[None], 60, 0).astype(np.float32)
    mask = np.zeros((15, 15), bool)
    mask[:, :8] = True
    alpha = matte(mask, large)
    np.testing.assert_allclose(alpha[30], share, atol=0.06)
    assert (alpha[:, :20] == 1).all() and (alpha[:, 44:] == 0).all()


@pytest.mark.parametrize("blur", [2.0, 8.0])
@pytest.mark.parametrize("wall", [(0.1, 0.3, 0.6), (0.62, 0.33, 0.2)], ids=["other", "alike"])
def test_a_border_out_of_focus_is_as_soft_as_the_photo(wall, blur):
    step = np.float32(np.arange(160) < 84)[None].repeat(160, 0)
    share = cv2.GaussianBlur(step, (0, 0), blur)
    large = share[..., None] * np.float32((0.7, 0.3, 0.1)) + (1 - share[..., None]) * np.float32(
        wall
    )
    mask = np.zeros((40, 40), bool)
    mask[:, :21] = True
    alpha = matte(mask, large)
    assert np.abs(alpha - share).max() < 0.08


def test_a_part_of_a_matte_is_that_of_the_whole():
    large = np.random.default_rng(0).random((240, 300, 3), np.float32)
    rows, columns = np.mgrid[:60, :75]
    mask = np.hypot(rows - 28, columns - 34) < 19
    large[np.kron(mask, np.ones((4, 4), bool))] *= 0.5
    whole = matte(mask, large)
    for box in (np.s_[0:240, 0:300], np.s_[37:111, 150:151], np.s_[200:240, 0:90]):
        np.testing.assert_array_equal(matte(mask, large, box), whole[box])


def test_a_pattern_with_the_colour_of_what_is_behind_it_has_no_holes():
    rows, columns = np.mgrid[:80, :80]
    dark = (rows // 5 + columns // 5) % 2 == 1
    large = np.where(dark & (columns < 46), 0.1, 0.7)[..., None] * np.ones(3, np.float32)
    mask = np.zeros((20, 20), bool)
    mask[:, :11] = True  # up to native column 44
    alpha = matte(mask, large.astype(np.float32))
    assert (alpha[:, :42] > 0.99).all() and (alpha[:, 46:] < 0.5).all()


def test_a_bright_rim_is_no_mixture():
    """The lip of a vase, brighter than vase and wall, is the vase's where the mask says so, and a lit edge behind its
    outline is not."""
    body = np.array([0.6, 0.25, 0.08])
    wall = np.array([0.25, 0.25, 0.25])
    lip = np.array([0.95, 0.8, 0.6])
    rows = np.arange(80)[:, None, None]
    large = np.where(rows < 32, wall, np.where(rows < 40, lip, body)) + np.zeros((80, 80, 3))
    mask = np.zeros((20, 20), bool)
    mask[8:] = True  # from native row 32 on
    alpha = matte(mask, large.astype(np.float32))[:, 40]
    assert (alpha[34:] > 0.95).all() and (alpha[:30] < 0.05).all()
    mask[8:10] = False  # the lip belongs to what is behind
    alpha = matte(mask, large.astype(np.float32))[:, 40]
    assert (alpha[42:] > 0.95).all() and (alpha[:38] < 0.05).all()


@pytest.mark.parametrize("wall", [(0.1, 0.3, 0.6), (0.9, 0.4, 0.1)], ids=["other", "same colour"])
def test_a_slanted_border_has_no_steps_of_working_pixels(wall):
    """Along the photo's edge, and as smooth where both sides look alike."""
    rows, columns = np.mgrid[:160, :160] + 0.5
    inside = columns + 0.4 * rows < 100
    large = np.where(inside[..., None], (0.9, 0.4, 0.1), wall).astype(np.float32)
    mask = inside.reshape(40, 4, 40, 4).mean((1, 3)) > 0.5
    found = (matte(mask, large) > 0.5).sum(1) + 0.4 * (np.arange(160) + 0.5)
    middle = found[20:140]
    assert np.abs(middle - 100).max() < (1.1 if wall[0] < 0.5 else 2.0)


def test_a_border_moves_to_the_edge_that_the_mask_missed():
    large = np.full((80, 80, 3), (0.1, 0.3, 0.6), np.float32)
    large[:, :40] = (0.9, 0.4, 0.1)
    mask = np.zeros((20, 20), bool)
    mask[:, :8] = True  # two working pixels short
    alpha = matte(mask, large)
    assert (alpha[:, :38] > 0.9).all() and (alpha[:, 42:] < 0.1).all()


def test_unmixed_colours_are_those_of_both_sides_and_give_the_picture():
    front = np.array([0.7, 0.1, 0.05])
    back = np.array([0.2, 0.4, 0.3])
    share = np.clip((30.5 - np.arange(60)) / 6 + 0.5, 0, 1)[None].repeat(40, 0).astype(np.float32)
    part = share[..., None]
    picture = (part * front + (1 - part) * back).astype(np.float32)
    sides = unmixed(share, picture, 3.0)
    np.testing.assert_allclose(part * sides[0] + (1 - part) * sides[1], picture, atol=1e-5)
    half = (share > 0.3) & (share < 0.7)
    for side, colour in zip(sides, (front, back), strict=True):
        assert np.abs(side[half] - colour).max() < 0.12
