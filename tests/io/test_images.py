"""EXR, PNG, maps, masks and the contact sheet."""

import os
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from made_scene import make_scene
from PIL import Image

from materialist.color import linear_to_srgb
from materialist.errors import InputError, OutputError
from materialist.io.exr import read_exr, write_exr
from materialist.io.image import ensure_image_writable, read_map, read_mask, write_image, write_png
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


def test_half_exr_and_strided_input(tmp_path):
    array = np.random.default_rng(0).random((6, 8, 3), np.float32)[::-1, ::2]
    write_exr(tmp_path / "a.exr", array, half=True)
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr"), array.astype(np.float16).astype(np.float32))


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


def test_exr_of_the_renderer(shared):
    maps = shared / "official_indoor/maps"
    assert read_exr(maps / "albedo.exr").shape == (512, 512, 3)
    assert read_exr(maps / "depth.exr").shape == (512, 512)


def test_png_is_srgb_and_right_way_up(tmp_path):
    linear = np.random.default_rng(0).random((5, 9, 3), np.float32) * 1.5 - 0.2
    write_png(tmp_path / "a.png", linear)
    pixels = np.asarray(Image.open(tmp_path / "a.png"))
    np.testing.assert_array_equal(pixels, np.round(linear_to_srgb(linear) * 255))


def test_write_image_is_whole_and_asks_before_replacing(tmp_path, monkeypatch):
    linear = np.random.default_rng(0).random((5, 9, 3), np.float32)
    write_image(tmp_path / "new/a.exr", linear)
    np.testing.assert_array_equal(read_exr(tmp_path / "new/a.exr"), linear)
    with pytest.raises(OutputError, match="--force"):
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
    photo = np.random.default_rng(0).integers(40, 200, (40, 60, 3)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "photo.png"), photo)
    with pytest.raises(InputError, match="a colour picture, not a mask"):
        read_mask(tmp_path / "photo.png", (40, 60))


@pytest.mark.parametrize("shape", [(40, 40), (60, 24), (96, 12), (24, 60), (12, 96)])
def test_overview_of_any_shape(shape):
    sheet = overview(make_scene(*shape))
    assert sheet.dtype == np.uint8 and sheet.shape[1:] == (1600, 3) and 500 < sheet.shape[0] < 3200


def test_overview_shows_the_photo_and_its_error(scene):
    sheet = overview(scene)
    assert (sheet == overview(scene)).all()
    changed = overview(replace(scene, rerender=scene.photo.linear))
    rows, columns = np.nonzero((sheet != changed).any(-1))
    # The photo's own tile, the left third of the first row, must not depend on the re-rendering.
    assert columns[rows < 500].min() > 540


def test_overview_of_a_scene_with_nothing_in_it(scene):
    """All sky, no faces, black light: still a sheet."""
    empty = replace(scene.geometry.mesh, faces=np.zeros((0, 3), np.int32), face_plane=np.zeros(0, np.int16))
    geometry = replace(scene.geometry, mesh=replace(empty, face_pixel=np.zeros(0, np.int32)))
    bare = replace(scene, depth=scene.depth * 0, envmap=scene.envmap * 0, geometry=geometry)
    assert overview(bare).shape[1] == 1600


def write_channels(path, **channels):
    import OpenEXR

    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}, channels) as file:
        file.write(str(path))


def test_the_picture_among_layers_of_an_exr(tmp_path):
    from materialist.io.exr import read_exr

    flat = lambda value, kind=np.float32: np.full((6, 8), value, kind)  # noqa: E731
    layers = {
        f"{name}.{c}": flat(value + k) for name, value in (("albedo", 1), ("beauty", 5)) for k, c in enumerate("RGB")
    }
    write_channels(tmp_path / "layers.exr", **layers, **{"depth.Z": flat(9)})
    np.testing.assert_array_equal(read_exr(tmp_path / "layers.exr")[0, 0], [5, 6, 7])
    write_channels(
        tmp_path / "mixed.exr", R=flat(1, np.float16), G=flat(2, np.float16), B=flat(3, np.float16), A=flat(1)
    )
    np.testing.assert_array_equal(read_exr(tmp_path / "mixed.exr")[0, 0], [1, 2, 3, 1])
    write_channels(tmp_path / "plain.exr", **layers, R=flat(1), G=flat(2), B=flat(3))
    np.testing.assert_array_equal(read_exr(tmp_path / "plain.exr")[0, 0], [1, 2, 3])
    write_channels(
        tmp_path / "blender.exr",
        **{f"View.Combined.{c}": flat(k) for k, c in enumerate("RGBA")},
        **{"View.Mist.Z": flat(9)},
    )
    np.testing.assert_array_equal(read_exr(tmp_path / "blender.exr")[0, 0], [0, 1, 2, 3])


def tiff(path, pixels, *, planar=1, photometric=2):
    """A 16-bit TIFF [H, W, 3] or [H, W], its channels together (planar 1) or one after the other (2)."""
    import struct

    height, width = pixels.shape[:2]
    bands = 1 if pixels.ndim == 2 else 3
    planes = [pixels] if planar == 1 or bands == 1 else [pixels[..., k] for k in range(bands)]
    strips = [np.ascontiguousarray(plane, "<u2").tobytes() for plane in planes]
    start = 8 + sum(len(strip) for strip in strips)
    places = [8 + sum(len(s) for s in strips[:k]) for k in range(len(strips))]
    tags = [(256, 4, [width]), (257, 4, [height]), (258, 3, [16] * bands), (259, 3, [1]), (262, 3, [photometric]),
            (273, 4, places), (277, 3, [bands]), (278, 4, [height]), (279, 4, [len(s) for s in strips]),
            (284, 3, [planar])]  # fmt: skip
    entries, extra = b"", b""
    after = start + 2 + 12 * len(tags) + 4
    for tag, kind, values in tags:
        data = struct.pack("<" + ("H" if kind == 3 else "I") * len(values), *values)
        if len(data) > 4:
            entries += struct.pack("<HHII", tag, kind, len(values), after + len(extra))
            extra += data
        else:
            entries += struct.pack("<HHI", tag, kind, len(values)) + data.ljust(4, b"\0")
    head = struct.pack("<2sHI", b"II", 42, start)
    path.write_bytes(head + b"".join(strips) + struct.pack("<H", len(tags)) + entries + b"\0" * 4 + extra)
    return path


def test_deep_tiffs_of_odd_layouts(tmp_path):
    from materialist.errors import InputError
    from materialist.io.decode import decode

    ramp = np.linspace(0, 65535, 32 * 24).reshape(24, 32).astype(np.uint16)
    colour = np.stack([ramp, ramp[::-1], ramp[:, ::-1]], -1)
    together = decode(tiff(tmp_path / "a.tif", colour)).linear
    assert together[0, 0, 0] < 0.01 < together[-1, -1, 0]
    with pytest.raises(InputError, match="interleaved"):
        decode(tiff(tmp_path / "b.tif", colour, planar=2))
    with pytest.raises(InputError, match="inverted"):
        decode(tiff(tmp_path / "c.tif", ramp, photometric=0))


def _exr(path, **channels):
    import OpenEXR

    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {name: np.full((9, 12), v, np.float32) for name, v in channels.items()}) as file:
        file.write(str(path))


def test_a_photo_is_the_layer_with_colours_whatever_lies_beside_it(tmp_path):
    """A depth beside the picture, or before it as a part of its own, is none; as a map it is what is asked for."""
    import OpenEXR

    layered = {"beauty.R": 0.2, "beauty.G": 0.4, "beauty.B": 0.6, "Z": 7.0}
    _exr(tmp_path / "layers.exr", **layered)
    assert np.allclose(read_exr(tmp_path / "layers.exr", photo=True), [0.2, 0.4, 0.6])
    assert np.allclose(read_exr(tmp_path / "layers.exr"), 7) and read_exr(tmp_path / "layers.exr").ndim == 2
    pixels = lambda value: np.full((9, 12), value, np.float32)  # noqa: E731
    parts = [OpenEXR.Part({}, {"Z": pixels(7)}, "depth"),
             OpenEXR.Part({}, {"R": pixels(0.2), "G": pixels(0.4), "B": pixels(0.6)}, "rgb")]  # fmt: skip
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "parts.exr"))
    assert np.allclose(read_exr(tmp_path / "parts.exr", photo=True), [0.2, 0.4, 0.6])
    _exr(tmp_path / "depth.exr", Z=7.0)
    with pytest.raises(InputError, match="RGB or Y is needed"):
        read_exr(tmp_path / "depth.exr", photo=True)
    _exr(tmp_path / "grey.exr", Y=0.3, A=0.5)
    assert np.allclose(read_exr(tmp_path / "grey.exr", photo=True), [0.3, 0.3, 0.3, 0.5])


def test_what_is_transparent_is_outside_of_a_mask(tmp_path):
    pixels = np.full((20, 30, 4), 255, np.uint8)
    pixels[..., 3] = 0
    pixels[5:15, 10:20, 3] = 255
    cv2.imwrite(str(tmp_path / "m.png"), pixels)
    assert read_mask(tmp_path / "m.png", (20, 30)).sum() == 100
    assert read_map(tmp_path / "m.png").min() == 1, "a map has no alpha"


@pytest.mark.parametrize("name", ["a.png", "a.exr"])
def test_errors_name_the_file_that_was_asked_for(tmp_path, name, monkeypatch):
    from materialist.io import image

    def fails(path, linear):
        raise OutputError(f"{path} cannot be written: no space left.")

    monkeypatch.setattr(image, f"write_{name[2:]}", fails)
    with pytest.raises(OutputError) as error:
        image.write_image(tmp_path / name, np.zeros((2, 2, 3), np.float32))
    assert str(error.value) == f"{tmp_path / name} cannot be written: no space left." and not list(tmp_path.iterdir())


def test_a_file_in_place_of_a_folder_is_named(tmp_path):
    from materialist.io.atomic import ensure_writable
    from materialist.io.image import ensure_image_writable

    (tmp_path / "photo.png").touch()
    for check, name in ((ensure_image_writable, "deep/out.png"), (ensure_writable, "out.scene")):
        with pytest.raises(OutputError, match=r"photo\.png is a file, not a folder"):
            check(tmp_path / "photo.png" / name)
