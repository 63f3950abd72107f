"""EXR, PNG, maps, masks and the contact sheet."""

import os
import threading
from concurrent.futures import ThreadPoolExecutor

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from made_png import png_header
from made_scene import make_scene
from PIL import Image

from materialist.color import srgb_to_linear
from materialist.errors import InputError, OutputError
from materialist.io.atomic import whole_file
from materialist.io.bitmap import pixel_limit_lifted
from materialist.io.decode import decode
from materialist.io.exr import read_exr, write_exr
from materialist.io.exr_photo import read_exr_photo
from materialist.io.image import ensure_image_writable, read_map, read_mask, write_image
from materialist.io.overview import overview


@settings(deadline=None, max_examples=25)
@given(data=st.data(), channels=st.sampled_from([(), (3,), (4,)]))
def test_exr_round_trip_is_exact(data, channels, tmp_path_factory):
    size = data.draw(st.tuples(st.integers(1, 9), st.integers(1, 9)))
    array = data.draw(hnp.arrays(np.float32, (*size, *channels), elements=st.floats(width=32)))
    path = tmp_path_factory.getbasetemp() / "a.exr"
    write_exr(path, array)
    back = read_exr(path)
    assert back.dtype == np.float32
    np.testing.assert_array_equal(back, array)


def test_exr_errors(tmp_path):
    with pytest.raises(InputError, match=r"\[2, 2, 2\]"):
        write_exr(tmp_path / "a.exr", np.zeros((2, 2, 2)))
    with pytest.raises(OutputError, match="cannot be written"):
        write_exr(tmp_path / "no/such/a.exr", np.zeros((2, 2)))
    with pytest.raises(InputError, match="no EXR"):
        read_exr(tmp_path / "a.exr")
    (tmp_path / "a.exr").write_bytes(b"v/1\x01" + b"x" * 100)
    with pytest.raises(InputError, match="readable EXR"):
        read_exr(tmp_path / "a.exr")


def test_write_image_is_whole_and_asks_before_replacing(tmp_path, monkeypatch):
    linear = np.random.default_rng(0).random((5, 9, 3), np.float32)
    with pytest.raises(OutputError, match=r"no folder .*mkdir -p .*new"):
        write_image(tmp_path / "new/a.exr", linear)
    assert not (tmp_path / "new").exists()
    (tmp_path / "new").mkdir()
    write_image(tmp_path / "new/a.exr", linear)
    np.testing.assert_array_equal(read_exr(tmp_path / "new/a.exr"), linear)
    with pytest.raises(OutputError, match="force=True"):
        write_image(tmp_path / "new/a.exr", linear)
    write_image(tmp_path / "new/a.exr", linear * 2, force=True)
    np.testing.assert_array_equal(read_exr(tmp_path / "new/a.exr"), linear * 2)
    assert os.listdir(tmp_path / "new") == ["a.exr"]
    with pytest.raises(InputError, match=r"\.png"):
        ensure_image_writable(tmp_path / "a.jpg")
    with pytest.raises(OutputError):
        ensure_image_writable("/proc/a.png")


def test_maps_of_8_and_16_bits_are_scaled_not_decoded(tmp_path):
    values = np.random.default_rng(0).integers(0, 256, (6, 7, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "a.png"), values[..., ::-1])
    np.testing.assert_allclose(read_map(tmp_path / "a.png"), values / 255, atol=1e-7)
    cv2.imwrite(str(tmp_path / "b.png"), values[..., 0].astype(np.uint16) * 257)
    np.testing.assert_allclose(read_map(tmp_path / "b.png"), values[..., 0] / 255, atol=1e-7)
    for name, content in (("c.png", b""), ("d.png", b"text")):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match="readable"):
            read_map(tmp_path / name)


def test_maps_of_more_pixels_than_a_photo_are_refused_by_their_header(tmp_path):
    (tmp_path / "huge.png").write_bytes(png_header(20000, 20000))
    for read in (read_map, lambda path: read_mask(path, (20, 20))):
        with pytest.raises(InputError, match="the limit is 200 megapixels"):
            read(tmp_path / "huge.png")


def test_masks(tmp_path):
    mask = np.zeros((40, 60), np.uint8)
    mask[10:20, 30:50] = 255
    cv2.imwrite(str(tmp_path / "m.png"), mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "m.png", (40, 60)), mask > 0)
    small = read_mask(tmp_path / "m.png", (20, 30), (40, 60))
    assert small.dtype == bool and small.sum() == 5 * 10 and small[5:10, 15:25].all()
    with pytest.raises(InputError, match="60 x 40 pixels, the photo 30 x 30"):
        read_mask(tmp_path / "m.png", (30, 30))
    cv2.imwrite(str(tmp_path / "e.png"), mask * 0)
    with pytest.raises(InputError, match="empty"):
        read_mask(tmp_path / "e.png", (40, 60))
    cv2.imwrite(str(tmp_path / "red.png"), mask[..., None] * np.uint8([0, 0, 1]))
    np.testing.assert_array_equal(read_mask(tmp_path / "red.png", (40, 60)), mask > 0)
    cv2.imwrite(str(tmp_path / "alpha.png"), np.dstack([np.full((40, 60, 3), 255, np.uint8), mask]))
    np.testing.assert_array_equal(
        read_mask(tmp_path / "alpha.png", (40, 60)), mask > 0
    )  # transparent is outside
    assert read_map(tmp_path / "alpha.png").min() == 1, "a map has no alpha"
    photo = np.random.default_rng(0).integers(40, 200, (40, 60, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    with pytest.raises(InputError, match="a colour picture, not a mask"):
        read_mask(tmp_path / "photo.png", (40, 60))


@pytest.mark.parametrize("side", [6, 30])
@pytest.mark.parametrize("kind", ["colour", "grey", "black", "white"])
def test_a_cut_out_object_is_a_mask_by_its_alpha(tmp_path, side, kind):
    rgba = np.zeros((40, 60, 4), np.uint8)
    noise = np.random.default_rng(0).integers(20, 230, (side, side, 3)).astype(np.uint8)
    object_colours = {"colour": noise, "grey": noise[..., :1], "black": 0, "white": 255}
    rgba[4 : 4 + side, 10 : 10 + side, :3] = object_colours[kind]
    rgba[4 : 4 + side, 10 : 10 + side, 3] = 255
    cv2.imwrite(str(tmp_path / "cut.png"), rgba)
    np.testing.assert_array_equal(read_mask(tmp_path / "cut.png", (40, 60)), rgba[..., 3] > 0)


def test_black_and_white_that_is_painted_on_transparency_is_a_mask(tmp_path):
    rgba = np.zeros((40, 60, 4), np.uint8)
    rgba[:30, :, 3] = 255
    rgba[5:12, 8:20, :3] = 255
    cv2.imwrite(str(tmp_path / "painted.png"), rgba)
    np.testing.assert_array_equal(read_mask(tmp_path / "painted.png", (40, 60)), rgba[..., 0] > 0)


def test_the_reported_cut_out(real_data):
    mask = read_mask(real_data("data/reported/mask_cutout/cutout0.png"), (64, 96))
    assert mask.sum() == 384 and mask[16:32, 24:48].all()


@pytest.mark.parametrize("shape", [(40, 40), (60, 24), (96, 12), (24, 60), (12, 96)])
def test_overview_of_any_shape(shape):
    sheet = overview(make_scene(*shape))
    assert sheet.dtype == np.uint8 and sheet.shape[1:] == (1600, 3) and 500 < sheet.shape[0] < 3200


def write_channels(path, **channels):
    """An EXR of constant channels, float32 unless they have another type."""
    flat = {
        name: np.full((9, 12), v, getattr(v, "dtype", np.float32)) for name, v in channels.items()
    }
    with OpenEXR.File(
        {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, flat
    ) as file:
        file.write(str(path))
    return path


LAYERS = {
    f"{name}.{c}": value + k
    for name, value in (("albedo", 1), ("beauty", 5))
    for k, c in enumerate("RGB")
}


@pytest.mark.parametrize(
    ("channels", "photo", "expected"),
    [
        ({**LAYERS, "depth.Z": 9}, False, [5, 6, 7]),
        ({"R": np.float16(1), "G": np.float16(2), "B": np.float16(3), "A": 1}, False, [1, 2, 3, 1]),
        ({**LAYERS, "R": 1, "G": 2, "B": 3}, False, [1, 2, 3]),
        (
            {f"View.Combined.{c}": k for k, c in enumerate("RGBA")} | {"View.Mist.Z": 9},
            False,
            [0, 1, 2, 3],
        ),
        ({**LAYERS, "Z": 9}, False, 9),
        ({**LAYERS, "Z": 9}, True, [5, 6, 7]),
        ({"Y": 0.5, "A": 0.25}, True, [0.5, 0.5, 0.5, 0.25]),
        ({"Y": 0.5, "A": 0.25}, False, 0.5),
    ],
)
def test_the_picture_among_the_channels_of_an_exr(tmp_path, channels, photo, expected):
    file = write_channels(tmp_path / "a.exr", **channels)
    if photo:
        decoded = read_exr_photo(file)
        alpha = [] if decoded.alpha is None else [decoded.alpha]
        found = np.concatenate([decoded.linear, *alpha], -1)
    else:
        found = read_exr(file)
    np.testing.assert_array_equal(found[0, 0], expected)


def test_a_depth_is_no_photo(tmp_path):
    """Alone it is refused; before the picture, as a part of its own, it is passed over."""
    with pytest.raises(InputError, match="RGB or Y is needed"):
        read_exr_photo(write_channels(tmp_path / "depth.exr", Z=7))

    def pixels(value):
        return np.full((9, 12), value, np.float32)

    parts = [
        OpenEXR.Part({}, {"Z": pixels(7)}, "depth"),
        OpenEXR.Part({}, {"R": pixels(0.25), "G": pixels(0.5), "B": pixels(0.75)}, "rgb"),
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "parts.exr"))
    assert np.allclose(read_exr_photo(tmp_path / "parts.exr").linear, [0.25, 0.5, 0.75])


RGB = np.linspace(0.1, 0.9, 20 * 30 * 3, dtype=np.float32).reshape(20, 30, 3)
DEEP = np.round(RGB * 65535).astype(np.uint16)


@pytest.mark.parametrize(
    ("pixels", "settings", "light"),
    [
        (np.moveaxis(DEEP, -1, 0), {"planarconfig": "separate"}, srgb_to_linear(DEEP)),
        (np.moveaxis(RGB, -1, 0), {"planarconfig": "separate"}, RGB),
        (RGB.astype(np.float16), {}, RGB),
        (DEEP.astype(np.uint32) * 65537, {}, srgb_to_linear(DEEP)),
        (DEEP, {"compression": "lzma"}, srgb_to_linear(DEEP)),
        (
            65535 - DEEP[..., 0],
            {"photometric": "miniswhite", "byteorder": ">"},
            srgb_to_linear(DEEP[..., :1]),
        ),
        (
            np.concatenate([DEEP, DEEP[..., :1], np.full_like(DEEP[..., :1], 65535)], -1),
            {"extrasamples": ["unspecified", "unassalpha"]},
            srgb_to_linear(DEEP),
        ),
    ],
    ids=["planes", "planes of floats", "half", "32 bits", "lzma", "inverted", "five channels"],
)
def test_deep_tiffs_of_odd_layouts(tmp_path, pixels, settings, light):
    tifffile.imwrite(tmp_path / "a.tif", pixels, **{"photometric": "rgb", **settings})
    found = decode(tmp_path / "a.tif").linear
    np.testing.assert_allclose(found, np.broadcast_to(light, found.shape), atol=1e-3)


def test_the_alpha_of_a_deep_grey_tiff(tmp_path):
    half = np.stack([DEEP[..., 0], np.full_like(DEEP[..., 0], 32768)], -1)
    tifffile.imwrite(
        tmp_path / "a.tif", half, photometric="minisblack", extrasamples=["unassalpha"]
    )
    decoded = decode(tmp_path / "a.tif")
    expected = np.repeat(srgb_to_linear(DEEP[..., :1]) / 2 + 0.5, 3, -1)
    np.testing.assert_allclose(decoded.linear, expected, atol=1e-3)
    assert "over white" in " ".join(decoded.warnings)


@pytest.mark.parametrize(
    ("pixels", "settings", "words"),
    [
        (np.zeros((20, 30), np.complex64), {}, "1 channels of complex64 .* not read"),
        (np.zeros((20, 30, 3), np.int16), {"photometric": "rgb"}, "of int16 .* not read"),
        (np.zeros((20, 30, 3), np.int8), {"photometric": "rgb"}, "of int8 .* not read"),
        (np.zeros((20, 30), np.float32), {"photometric": "miniswhite"}, "float32, inverted"),
        (
            np.zeros((20, 30, 4), np.uint16),
            {"photometric": "rgb", "extrasamples": ["assocalpha"]},
            "premultiplied",
        ),
    ],
)
def test_deep_tiffs_that_are_not_read_say_so(tmp_path, pixels, settings, words):
    tifffile.imwrite(tmp_path / "a.tif", pixels, **settings)
    with pytest.raises(InputError, match=words):
        decode(tmp_path / "a.tif")


def test_several_threads_write_one_file_and_lift_one_limit(tmp_path):
    before = Image.MAX_IMAGE_PIXELS
    both = threading.Barrier(2)
    entered = threading.Semaphore(0)

    def write(content):
        with whole_file(tmp_path / "a.txt", force=True) as temporary:
            temporary.write_text(content)
            both.wait(10)

    def lift(leave):
        with pixel_limit_lifted():
            entered.release()
            leave.wait(10)

    with ThreadPoolExecutor(2) as threads:
        for done in [threads.submit(write, "x") for _ in range(2)]:
            done.result()
        ends = threading.Event(), threading.Event()
        lifted = []
        for end in ends:
            lifted.append(threads.submit(lift, end))
            entered.acquire(timeout=0.2)
        for end, done in zip(ends, lifted):
            end.set()
            done.result()
    assert [file.name for file in tmp_path.iterdir()] == [
        "a.txt"
    ] and before == Image.MAX_IMAGE_PIXELS
