"""Enlarged layers follow the photo's edges; mixed pixels are told apart by their colour."""

import numpy as np

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.edits.composite.matte import matte
from materialist.edits.composite.upsample import GuidedUpsample


def photo_of(mask, inside, outside):
    return np.where(mask[..., None], inside, outside).astype(np.float32)


def test_values_stay_on_their_side_of_an_edge_that_only_the_large_photo_resolves():
    # The true edge runs at native column 21, inside a working pixel (4 native ones each).
    native = np.zeros((40, 40), bool)
    native[:, :21] = True
    large = photo_of(native, (0.8, 0.2, 0.1), (0.1, 0.3, 0.7))
    small = large.reshape(10, 4, 10, 4, 3).mean((1, 3))
    layer = (np.arange(10) < 5).astype(np.float32)[None, :, None].repeat(10, 0)
    whole = slice(0, 40)
    out = GuidedUpsample(layer, small, (40, 40))(whole, whole, large)[..., 0]
    assert out[:, :20].min() > 0.9 and out[:, 22:].max() < 0.1


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
