"""Shadows and reflections of an object on the ground, found in the photo."""

import numpy as np
import pytest

from materialist.edits.remove.cast import cast

SHAPE = (120, 160)
Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]
OBJECT = (np.abs(X - 80) < 18) & (Y > 30) & (Y < 78)
ORANGE = np.array([0.8, 0.25, 0.03])
GROUND = Y >= 50
SHADOW = GROUND & (((X - 108) / 26.0) ** 2 + ((Y - 72) / 9.0) ** 2 < 1) & ~OBJECT
REFLECTION = (np.abs(X - 80) < 16) & (Y >= 78) & (Y < 96)


def photo(texture=0.0, shade=0.6, tint=0.25):
    """A grey table that falls off to one side, an orange box on it, its shadow and its reflection."""
    rng = np.random.default_rng(3)
    table = 0.6 * np.exp(-0.003 * X) * np.exp(texture * rng.standard_normal(SHAPE))
    picture = np.where(GROUND, table, 0.3)[..., None] * np.ones(3)
    picture[SHADOW] *= shade
    picture[REFLECTION] = (1 - tint) * picture[REFLECTION] + tint * 0.5 * ORANGE
    picture[OBJECT] = ORANGE
    return picture


def found_in(picture, upward=GROUND):
    import cv2

    plane = np.where(GROUND, 0, 1)
    gone = cv2.dilate(OBJECT.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    return cast(picture, plane, upward, OBJECT, gone), gone


def hit_and_missed(found, wanted):
    """The share of what is wanted that was found, and what was found farther than 5 pixels from it."""
    import cv2

    near = cv2.dilate(wanted.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0
    return (found & wanted).sum() / wanted.sum(), int((found & ~near).sum())


def test_both_are_found_and_little_else():
    found, gone = found_in(photo())
    hit, stray = hit_and_missed(found, (SHADOW | REFLECTION) & ~gone)
    assert hit > 0.9 and stray == 0
    assert not (found & gone).any() and not (found & ~GROUND).any()


@pytest.mark.parametrize(("shade", "tint", "wanted"), [(0.6, 0, SHADOW), (1, 0.25, REFLECTION)])
def test_each_of_them_alone(shade, tint, wanted):
    found, gone = found_in(photo(shade=shade, tint=tint))
    hit, stray = hit_and_missed(found, wanted & ~gone)
    assert hit > 0.9 and stray == 0


def test_nothing_is_found_where_nothing_is():
    assert not found_in(photo(shade=1, tint=0))[0].any()
    assert not found_in(photo(shade=0.6, tint=0), upward=np.zeros(SHAPE, bool))[0].any()


def test_grain_hides_a_faint_shadow_and_is_not_taken_for_one():
    assert not found_in(photo(texture=0.5, shade=0.93, tint=0))[0].any()


def test_a_dark_thing_beside_it_stays():
    picture = photo(shade=1, tint=0)
    picture[(X > 40) & (X < 56) & (Y > 60) & (Y < 76)] = 0.05
    assert not found_in(picture)[0].any()


def test_what_lies_behind_its_upper_part_stays():
    picture = photo(shade=1, tint=0)
    picture[(X > 90) & (Y >= 50) & (Y < 60)] *= 0.3  # the far edge of the table
    assert not found_in(picture)[0].any()
