"""Files of composites: the photo's own bits come back."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from edit_scenes import flat_scene

from materialist.edits.composite.composite import is_deep, write_composite
from materialist.io.decode import decode

SCENE = flat_scene()


def photo_from(path):
    linear = decode(path).linear
    return replace(SCENE.photo, linear=linear, original=linear, path=str(path), source=path.read_bytes())


@pytest.mark.parametrize(("dtype", "side"), [(np.uint8, 16), (np.uint16, 256)])
def test_every_value_comes_back(tmp_path, dtype, side):
    pixels = np.arange(side**2).astype(dtype).reshape(side, side)[..., None].repeat(3, -1)
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    photo = photo_from(tmp_path / "a.png")
    write_composite(tmp_path / "b.png", photo.original, photo)
    back = cv2.imread(str(tmp_path / "b.png"), cv2.IMREAD_UNCHANGED)
    assert back.dtype == dtype and is_deep(photo) == (dtype == np.uint16)
    np.testing.assert_array_equal(back, pixels)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "b.png"]


def test_a_saved_edit_of_a_16_bit_photo_stays_one(tmp_path):
    from materialist.edits.composite.composite import developed
    from materialist.io.package import load_scene, save_scene

    data = cv2.imencode(".png", np.full((36, 48, 3), 30000, np.uint16))[1].tobytes()
    scene = replace(SCENE, photo=replace(SCENE.photo, source=data, path="a.png"))
    save_scene(developed(scene, scene, scene.photo.original), tmp_path / "b.scene")
    again = load_scene(tmp_path / "b.scene")
    assert again.photo.source is None and is_deep(again.photo)
    save_scene(developed(SCENE, SCENE, SCENE.photo.original), tmp_path / "c.scene")
    assert not is_deep(load_scene(tmp_path / "c.scene").photo)
