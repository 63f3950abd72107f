"""Glass while a slider moves: inside the object the picture that composite makes, outside the photo."""

import numpy as np
import pytest
from edit_scenes import block_mask, rendered_scene

from materialist.edits.composite.composite import composite
from materialist.edits.glass.glass import glass
from materialist.edits.glass.preview import GlassPreview

MASK = block_mask(36, 48)


@pytest.fixture(scope="module")
def preview():
    return GlassPreview(rendered_scene(), MASK, thickness="symmetry")


def test_inside_it_is_the_final_picture_and_outside_the_photo(preview):
    scene = preview.scene
    quick = preview.picture(ior=1.3, tint=(1, 0.5, 0.5), spp=64)
    final = composite(scene, glass(scene, MASK, ior=1.3, tint=(1, 0.5, 0.5), thickness="symmetry"), spp=128)
    inner = np.zeros_like(MASK)
    inner[14:22, 14:24] = MASK[14:22, 14:24]
    assert np.abs(quick - final)[inner].mean() < 0.1 * final[inner].mean()
    np.testing.assert_array_equal(quick[:6], scene.photo.linear[:6])
    assert quick.dtype == np.float32 and (quick >= 0).all()


def test_the_glass_is_exchanged_and_comes_back(preview):
    clear = preview.picture(spp=16)
    red = preview.picture(tint=(1, 0.2, 0.2), spp=16)
    frosted = preview.picture(roughness=0.5, spp=16)
    coated = preview.picture(transmission=0.5, spp=16)
    ratio = (red[MASK].mean(0) + 0.01) / (clear[MASK].mean(0) + 0.01)
    assert ratio[1] < 0.75 and ratio[0] > 0.9
    for other in (frosted, coated):
        assert np.abs(other - clear)[MASK].max() > 0.01
    np.testing.assert_array_equal(preview.picture(spp=16), clear)
