"""Backgrounds and inpainters: what they show is seen where the object was."""

from dataclasses import replace

import numpy as np
import pytest
from edit_scenes import MASK, flat_scene, rendered_scene
from made_hub import save_inpainting

from materialist.edits.composite.composite import composite
from materialist.edits.remove.background import inpainter
from materialist.edits.remove.remove import remove
from materialist.errors import InputError, WeightsError
from materialist.io.exr import write_exr


def test_a_background_may_have_the_unit_of_the_photos_file(tmp_path):
    scene = rendered_scene()
    hdr = replace(scene, photo=replace(scene.photo, hdr=True, stops=7))
    write_exr(tmp_path / "behind.exr", scene.photo.original / 128)
    plain = remove(scene, MASK, background=scene.photo.linear)
    told = remove(hdr, MASK, background=tmp_path / "behind.exr")
    np.testing.assert_array_equal(told.photo.linear, plain.photo.linear)


def test_a_true_background_is_what_is_seen():
    scene = rendered_scene()
    y, x = np.mgrid[:36, :48]
    truth = np.stack([0.2 + 0.2 * (x % 6 < 3), 0.3 + 0.1 * (y % 8 < 4), 0.25 + 0 * x], -1).astype(
        np.float32
    )
    removed = remove(scene, MASK, background=truth)
    np.testing.assert_allclose(removed.photo.linear[MASK], truth[MASK], rtol=1e-5)
    picture = composite(scene, removed, spp=48, denoise=False)
    assert np.sqrt(((picture - truth) ** 2)[MASK].mean()) < 0.04


def test_options_out_of_range_and_backgrounds_of_another_aspect():
    scene = flat_scene()
    for options, message in (
        ({"grow": -1}, "rim is -1"),
        ({"shadow": np.nan}, "shadow is nan"),
        ({"background": np.ones((20, 20, 3))}, "same proportions"),
        ({"background": -np.ones((36, 48, 3))}, "negative"),
        ({"background": np.ones((36, 48, 3)), "inpaint": lambda photo, hole: photo}, "not both"),
    ):
        with pytest.raises(InputError, match=message):
            remove(scene, MASK, **options)


def test_an_inpainter_gets_the_photo_and_the_hole():
    scene = flat_scene()
    seen = []

    def paint(photo, hole):
        seen.append(hole)
        return np.where(hole[..., None], 0.4, photo)

    removed = remove(rendered_scene(), MASK, inpaint=paint)
    assert seen[0].shape == scene.depth.shape
    np.testing.assert_allclose(removed.photo.linear[MASK], 0.4)


@pytest.mark.parametrize(
    ("paint", "message"),
    [
        (lambda photo, hole: np.where(hole[..., None], np.nan, photo), "or NaN"),
        (lambda photo, hole: photo[..., 0], r"picture of the inpainter is \(36, 48\)"),
        (lambda photo, hole: None, "same proportions"),
        (lambda photo, hole: photo / hole.sum(2), "inpainter failed"),
    ],
)
def test_what_an_inpainter_gives_is_checked(paint, message):
    with pytest.raises(InputError, match=message):
        remove(flat_scene(), MASK, inpaint=paint)


def test_a_saved_pipeline_fills_the_hole_and_nothing_else(tmp_path):
    pytest.importorskip("diffusers")
    paint = inpainter(f"sd:{save_inpainting(tmp_path / 'sd')}", device="cpu", steps=2)
    photo = flat_scene().photo.linear
    one = paint(photo, MASK)
    two = paint(photo, MASK)
    assert one.shape == photo.shape and one.dtype == np.float32
    np.testing.assert_array_equal(one[~MASK], photo[~MASK])
    assert (one[MASK] != photo[MASK]).any() and one.min() >= 0 and one.max() <= 1
    np.testing.assert_array_equal(one, two)


def test_what_is_not_there_or_not_whole(tmp_path):
    pytest.importorskip("diffusers")
    with pytest.raises(InputError, match="give sd:FOLDER"):
        inpainter("lama")
    with pytest.raises(WeightsError, match="no folder"):
        inpainter(f"sd:{tmp_path / 'nowhere'}")
    folder = save_inpainting(tmp_path / "sd")
    next((folder / "unet").glob("*.safetensors")).unlink()
    with pytest.raises(WeightsError, match="unet"):
        inpainter(f"sd:{folder}", device="cpu")
