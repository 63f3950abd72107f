"""Which pixels a removal concerns: soft outlines, shadows and reflections on the ground, what is surrounded by them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene

from materialist.edits.remove.contact_shadow import contact_shadow
from materialist.edits.remove.hole import defocus_width, make_hole

Y, X = np.mgrid[:200, :300]
DISC = np.hypot(Y - 100, X - 150) < 50
ALL = np.ones_like(DISC)


def photo(blur):
    share = cv2.GaussianBlur(DISC.astype(np.float32), (0, 0), blur) if blur else DISC
    picture = share[..., None] * [0.7, 0.1, 0.05] + (1 - np.asarray(share)[..., None]) * [0.2, 0.3, 0.25]
    return picture.astype(np.float32)


@pytest.mark.parametrize("blur", [0, 3])
def test_outlines_are_as_soft_as_their_blur(blur):
    """A disc behind a Gaussian: in linear light a share s is left at s = 1 - Phi(distance / blur)."""
    found = defocus_width(photo(blur), DISC, ALL)
    assert abs(found - 1.5 * blur) <= 1.5 + 0.3 * blur


def test_what_lies_on_one_side_and_what_has_the_same_colour_does_not_count():
    beside = photo(0.5)
    beside[:, 200:] = [0.7, 0.1, 0.05]  # another one of its colour, and its shadow
    beside[150:160, 120:180] *= 0.4
    assert defocus_width(beside, DISC, ALL) <= 2
    assert defocus_width(np.full((200, 300, 3), 0.3, np.float32), DISC, ALL) == 0
    assert defocus_width(photo(1), ALL, ALL) == 0


def test_a_removal_takes_the_soft_outline_along_but_nothing_before_it():
    scene, mask = flat_scene(120, 160), block_mask(120, 160)
    sharp = np.where(mask[..., None], [0.8, 0.1, 0.1], [0.1, 0.3, 0.6]).astype(np.float32)
    soft = cv2.GaussianBlur(sharp, (0, 0), 2.0)
    seen = lambda linear: replace(scene, photo=replace(scene.photo, linear=linear, original=linear))  # noqa: E731
    near, wide = (make_hole(seen(linear), mask, grow=0.006, shadow=None).gone for linear in (sharp, soft))
    assert (near <= wide).all() and wide.sum() > near.sum()
    right = np.flatnonzero(mask.any(0))[-1]
    depth = scene.depth.copy()
    depth[:, right + 1 :] = 0.5 * depth[mask].min()
    before = make_hole(replace(seen(soft), depth=depth), mask, grow=0.006, shadow=None).gone
    assert before[:, right + 2 :].sum() < wide[:, right + 2 :].sum()


def on_floor():
    """The flat scene, its lower half a floor."""
    scene = flat_scene()
    floor = np.where(np.arange(36)[:, None] >= 20, 0, -1).astype(np.int8) * np.ones((1, 48), np.int8)
    normal = np.where(floor[..., None] == 0, [0.0, 1, 0], scene.normal).astype(np.float32)
    return replace(scene, normal=normal, geometry=replace(scene.geometry, plane_label=floor))


def test_a_given_shadow_widens_the_hole_on_the_ground_alone():
    mask = block_mask(36, 48)
    plain, wide = (make_hole(on_floor(), mask, grow=0.006, shadow=shadow) for shadow in (0.0, 0.5))
    np.testing.assert_array_equal(plain.painted, plain.gone)
    more = wide.painted & ~wide.gone
    assert more[20:].any() and not more[:20].any()
    np.testing.assert_array_equal(wide.gone, plain.gone)


class TestContactShadow:
    """An orange box on a grey table that falls off to one side, with its shadow and its reflection."""

    SHAPE = (120, 160)
    Y, X = np.mgrid[: SHAPE[0], : SHAPE[1]]
    OBJECT = (np.abs(X - 80) < 18) & (Y > 30) & (Y < 78)
    GROUND = Y >= 50
    SHADOW = GROUND & (((X - 108) / 26.0) ** 2 + ((Y - 72) / 9.0) ** 2 < 1) & ~OBJECT
    REFLECTION = (np.abs(X - 80) < 16) & (Y >= 78) & (Y < 96)
    GONE = cv2.dilate(OBJECT.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0

    def photo(self, texture=0.0, shade=0.6, tint=0.25):
        orange = np.array([0.8, 0.25, 0.03])
        grain = np.exp(texture * np.random.default_rng(3).standard_normal(self.SHAPE))
        picture = np.where(self.GROUND, 0.6 * np.exp(-0.003 * self.X) * grain, 0.3)[..., None] * np.ones(3)
        picture[self.SHADOW] *= shade
        picture[self.REFLECTION] = (1 - tint) * picture[self.REFLECTION] + tint * 0.5 * orange
        picture[self.OBJECT] = orange
        return picture

    def found(self, picture, ground=GROUND):
        return contact_shadow(picture, np.where(self.GROUND, 0, 1), ground, self.OBJECT, self.GONE)

    @pytest.mark.parametrize(
        ("shade", "tint", "wanted"), [(0.6, 0.25, SHADOW | REFLECTION), (0.6, 0, SHADOW), (1, 0.25, REFLECTION)]
    )
    def test_it_is_found_and_little_else(self, shade, tint, wanted):
        found, wanted = self.found(self.photo(shade=shade, tint=tint)), wanted & ~self.GONE
        near = cv2.dilate(wanted.astype(np.uint8), np.ones((11, 11), np.uint8)) > 0
        assert found[wanted].mean() > 0.9 and not (found & ~near).any()
        assert not (found & self.GONE).any() and not (found & ~self.GROUND).any()

    def test_nothing_is_found_where_nothing_is(self):
        plain = self.photo(shade=1, tint=0)
        assert not self.found(plain).any()
        assert not self.found(self.photo(), ground=np.zeros(self.SHAPE, bool)).any()
        assert not self.found(self.photo(texture=0.5, shade=0.93, tint=0)).any(), "grain hides it"
        thing = plain.copy()
        thing[(self.X > 40) & (self.X < 56) & (self.Y > 60) & (self.Y < 76)] = 0.05
        assert not self.found(thing).any(), "a dark thing beside it stays"
        plain[(self.X > 90) & (self.Y >= 50) & (self.Y < 60)] *= 0.3
        assert not self.found(plain).any(), "what lies behind its upper part stays"
