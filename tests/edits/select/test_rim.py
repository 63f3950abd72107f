"""The rim of an object beside its mask, on discs whose colours are known."""

import numpy as np
import pytest

from materialist.edits.select.rim import with_rim

SIDE = 256
RED = (0.7, 0.15, 0.1)
GREY = (0.5, 0.5, 0.5)


def within(radius, centre=(128, 128)):
    """[SIDE, SIDE] bool of a disc."""
    rows, columns = np.mgrid[:SIDE, :SIDE]
    return np.hypot(rows - centre[0], columns - centre[1]) < radius


def painted(inside, front, back, grain=0.02):
    rng = np.random.default_rng(0)
    picture = np.where(inside[..., None], front, back)
    return (picture + grain * rng.standard_normal(picture.shape)).clip(0, 1).astype(np.float32)


@pytest.mark.parametrize("missing", [1, 0])
def test_the_rest_of_a_disc_is_added_and_nothing_beside_it(missing):
    whole = within(60)
    result = with_rim(within(60 - missing), painted(whole, RED, GREY))
    assert (result & ~whole).sum() <= 0.02 * (whole & ~within(59)).sum()
    assert (whole & ~result).sum() <= 0.15 * (whole & ~within(59)).sum()


def test_a_shaded_rim_is_the_objects_too():
    whole = within(60)
    picture = painted(whole, RED, GREY)
    picture[whole & ~within(59)] *= 0.7
    result = with_rim(within(59), picture)
    assert (whole & ~result).sum() <= 0.25 * (whole & ~within(59)).sum()


def test_what_looks_alike_on_both_sides_stays_outside():
    mask = within(59)
    np.testing.assert_array_equal(with_rim(mask, painted(within(60), GREY, GREY)), mask)


def test_what_is_not_joined_to_the_mask_stays_outside():
    mask = within(59)
    picture = painted(mask, RED, GREY, grain=0)
    # A red ring, behind a grey one of a pixel.
    wide = within(59 + 2.5) & ~within(59 + 1.2)
    picture[wide] = RED
    result = with_rim(mask, np.ascontiguousarray(picture))
    assert (result & ~mask).sum() == 0


def test_a_thin_thing_in_front_stays_outside():
    whole = within(60)
    line = np.zeros_like(whole)
    line[:, 128] = True
    result = with_rim(whole & ~line, painted(whole & ~line, RED, GREY))
    assert (result & line & whole).sum() <= 0.1 * (line & whole).sum()


@pytest.mark.parametrize("mask", [within(0), within(999), within(2), within(60, (0, 128))])
def test_masks_of_any_kind(mask):
    result = with_rim(mask, painted(mask, RED, GREY))
    assert result.shape == mask.shape and result.dtype == bool
    assert not (mask & ~result).any()
    assert (result & ~mask).sum() <= 0.02 * mask.sum() + 2


def test_a_larger_picture_has_a_wider_rim():
    large, mask = (np.kron(within(radius), np.ones((4, 4))) > 0 for radius in (60, 59))
    result = with_rim(mask, painted(large, RED, GREY))
    assert (large & ~result).sum() <= 0.05 * (large & ~mask).sum()
