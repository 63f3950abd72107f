"""Which pixels a removal concerns: shadows and reflections on the ground, what is surrounded by them."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene

from materialist.edits.remove.contact_shadow import contact_shadow
from materialist.edits.remove.hole import make_hole


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
