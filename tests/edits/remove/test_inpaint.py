"""The diffusion inpainter, with a tiny pipeline of random weights saved as diffusers saves it."""

import numpy as np
import pytest
from edit_scenes import block_mask, flat_scene
from made_hub import save_inpainting

from materialist.edits.remove.inpaint import inpainter
from materialist.errors import InputError, WeightsError

pytest.importorskip("diffusers")
MASK = block_mask(36, 48)


def test_a_saved_pipeline_fills_the_hole_and_nothing_else(tmp_path):
    paint = inpainter(f"sd:{save_inpainting(tmp_path / 'sd')}", device="cpu", steps=2)
    photo = flat_scene().photo.linear
    one, two = paint(photo, MASK), paint(photo, MASK)
    assert one.shape == photo.shape and one.dtype == np.float32
    np.testing.assert_array_equal(one[~MASK], photo[~MASK])
    assert (one[MASK] != photo[MASK]).any() and one.min() >= 0 and one.max() <= 1
    np.testing.assert_array_equal(one, two)


def test_what_is_not_there_or_not_whole(tmp_path):
    with pytest.raises(InputError, match="give sd:FOLDER"):
        inpainter("lama")
    with pytest.raises(WeightsError, match="no folder"):
        inpainter(f"sd:{tmp_path / 'nowhere'}")
    folder = save_inpainting(tmp_path / "sd")
    next((folder / "unet").glob("*.safetensors")).unlink()
    with pytest.raises(WeightsError, match="unet"):
        inpainter(f"sd:{folder}", device="cpu")
