"""Photos from memory: arrays, Pillow's pictures and open files are read as files of them are."""

import io

import numpy as np
import pytest
from PIL import Image

from materialist.color import srgb_to_linear
from materialist.errors import InputError
from materialist.io.photo import read_photo
from materialist.io.photo_input import photo_of

LEVELS = np.random.default_rng(5).integers(0, 256, (12, 17, 3)).astype(np.uint8)


def test_display_arrays_are_what_a_png_of_them_is(tmp_path):
    Image.fromarray(LEVELS).save(tmp_path / "a.png")
    photo = photo_of(LEVELS, encoded=True)
    file = read_photo(tmp_path / "a.png")
    assert np.array_equal(photo.original, file.original) and photo.path is None and photo.source
    assert not photo.hdr and photo.fov_source == "default"
    deep = LEVELS.astype(np.uint16) * 257
    assert np.array_equal(photo_of(deep, encoded=True).original, srgb_to_linear(deep))
    floats = photo_of(LEVELS / 255, encoded=True)
    assert np.abs(floats.original - photo.original).max() < 1e-6
    assert np.array_equal(
        photo_of(LEVELS[..., 0], encoded=True).original, photo.original[..., :1].repeat(3, -1)
    )


def test_linear_arrays_are_light(tmp_path):
    light = np.random.default_rng(6).random((12, 17, 3)) ** 2 * 40
    photo = photo_of(light, size=8)
    assert photo.hdr and photo.stops < 0 and photo.linear.shape == (8, 11, 3)
    assert np.allclose(photo.original * 2.0**-photo.stops, light.astype(np.float32))
    clear = np.concatenate([light, np.full((12, 17, 1), 0.5)], -1)
    assert any("Transparent" in note for note in photo_of(clear).warnings)
    assert photo_of(light[..., 0]).original.shape == (12, 17, 3)


def test_pictures_keep_their_profile_and_exif():
    picture = Image.fromarray(LEVELS)
    exif = picture.getexif()
    exif[0x0112] = 6
    assert photo_of(picture).original.shape == (17, 12, 3)
    assert np.array_equal(
        photo_of(Image.fromarray(LEVELS)).original, photo_of(LEVELS, encoded=True).original
    )
    assert photo_of(picture.convert("CMYK")).warnings == (
        "CMYK without a usable profile: colours are approximate.",
    )
    assert photo_of(Image.fromarray(LEVELS[..., 0].astype(np.float32))).hdr


def test_open_files_are_read_from_where_they_stand(tmp_path):
    Image.fromarray(LEVELS).save(tmp_path / "kitchen.png")
    content = (tmp_path / "kitchen.png").read_bytes()
    with open(tmp_path / "kitchen.png", "rb") as file:
        photo = photo_of(file)
    assert photo.name == "kitchen.png" and photo.source == content
    assert photo_of(io.BytesIO(content)).path is None
    with (
        open(tmp_path / "kitchen.png", encoding="latin-1") as text,
        pytest.raises(InputError, match="binary mode"),
    ):
        photo_of(text)


@pytest.mark.parametrize(
    ("photo", "encoded", "words"),
    [
        (LEVELS, None, "display values: give encoded=True"),
        (LEVELS / 1.0, True, r"must lie in \[0, 1\]; these go from"),
        (LEVELS.astype(np.int64), True, "floats, uint8 or uint16; this is ndarray of int64"),
        (LEVELS.astype(np.uint32), True, "holds uint32"),
        (np.zeros((3, 4, 5, 6)), None, r"is \[3, 4, 5, 6\]"),
        (np.full((12, 12, 3), np.nan), None, "^The array has 144 pixels that are NaN"),
        (np.zeros((12, 12, 3)), None, "black"),
        (io.BytesIO(b""), None, r"^The open file is empty \(0 bytes\)"),
        (io.BytesIO(b"hello there, this is no picture"), None, "^The open file is not an image"),
        ("a.png", True, "leave it out for a file"),
        (io.BytesIO(), True, "leave it out for an open file"),
        (None, None, "this is NoneType of object"),
    ],
)
def test_what_is_no_photo(photo, encoded, words):
    with pytest.raises(InputError, match=words):
        photo_of(photo, encoded=encoded)
