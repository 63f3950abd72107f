"""Which pixels a removal concerns: shadows and reflections on the ground, what is surrounded by them."""

from dataclasses import replace

import numpy as np
from edit_scenes import block_mask, flat_scene

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
