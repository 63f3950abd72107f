"""Photos of every kind, and every kind of bad file."""

import io
import struct

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from made_png import chunk, png_header
from PIL import Image, ImageCms, ImageOps
from pillow_heif import register_heif_opener

from materialist.color import linear_to_srgb, srgb_to_linear
from materialist.errors import InputError
from materialist.io.decode import SUFFIXES
from materialist.io.exr import write_exr
from materialist.io.icc import matrix_profile
from materialist.io.image import read_map
from materialist.io.photo import decode_photo, exposed, read_photo
from materialist.types import Camera, Photo

XYZ_TO_SRGB = (
    (3.2404542, -1.5371385, -0.4985314),
    (-0.969266, 1.8760108, 0.041556),
    (0.0556434, -0.2040259, 1.0572252),
)


def picture(height=20, width=30, seed=0):
    """[H, W, 3] uint8, smooth enough for lossy formats."""
    y, x = np.mgrid[0:height, 0:width]
    waves = [np.sin(x / 5 + seed + k) + np.cos(y / 4 - k) for k in range(3)]
    return np.round(127 + 60 * np.stack(waves, -1)).clip(0, 255).astype(np.uint8)


def save(path, pixels, **options):
    Image.fromarray(pixels).save(path, **options)
    return path


@pytest.mark.parametrize("suffix", ["png", "tiff", "bmp", "webp"])
def test_lossless_8_bit_files_decode_exactly(tmp_path, suffix):
    pixels = picture()
    photo = read_photo(
        save(tmp_path / f"a.{suffix}", pixels, **({"lossless": True} if suffix == "webp" else {}))
    )
    np.testing.assert_allclose(photo.linear, srgb_to_linear(pixels), atol=1e-6)
    assert photo.linear.dtype == np.float32 and photo.linear.flags.c_contiguous
    assert photo.source == (tmp_path / f"a.{suffix}").read_bytes() and photo.warnings == ()
    assert (photo.camera.width, photo.camera.height, photo.camera.fov) == (30, 20, 35.0)
    assert not photo.hdr and photo.fov_source == "default"


@pytest.mark.parametrize("suffix", ["jpg", "heic", "avif"])
def test_lossy_files_decode_closely(tmp_path, suffix):
    register_heif_opener()
    pixels = picture(64, 96)
    photo = read_photo(save(tmp_path / f"a.{suffix}", pixels, quality=95))
    assert np.abs(linear_to_srgb(photo.linear) - pixels / 255).mean() < 0.02


@pytest.mark.parametrize("suffix", ["png", "tiff"])
@pytest.mark.parametrize("channels", [1, 3, 4])
def test_16_bits_stay_16_bits(tmp_path, suffix, channels):
    rng = np.random.default_rng(0)
    pixels = rng.integers(0, 65536, (16, 17, channels)).astype(np.uint16)
    if channels == 4:
        pixels[..., 3] = 65535
    cv2.imwrite(str(tmp_path / f"a.{suffix}"), pixels)
    photo = read_photo(tmp_path / f"a.{suffix}")
    colour = pixels[..., [0, 0, 0]] if channels == 1 else pixels[..., 2::-1]
    expected = srgb_to_linear(colour.astype(np.float64) / 65535)
    np.testing.assert_allclose(photo.linear, expected, atol=2e-6)
    assert photo.warnings == ()


def deep_picture(path, bits, channels):
    """Writes a lossless AVIF or JPEG 2000 of 9 to 16 bits a channel; its levels [H, W, C], RGB before alpha."""
    ramp = np.linspace(0, (1 << bits) - 1, 64 * 96).reshape(64, 96)
    turned = (ramp, ramp[::-1], ramp[:, ::-1], ramp)[:channels]
    levels = np.round(np.stack(turned, -1)).astype(np.uint16)
    stored = levels[..., [0] if channels == 1 else [2, 1, 0, 3][:channels]]
    if path.suffix == ".avif":
        if not cv2.haveImageWriter(str(path)):
            pytest.skip("OpenCV before 4.12 writes no AVIF")
        cv2.imwrite(
            str(path), stored, [cv2.IMWRITE_AVIF_DEPTH, bits, cv2.IMWRITE_AVIF_QUALITY, 100]
        )
        return levels
    # OpenCV writes 16 bits. The middle of the range lies where that of fewer bits does, and the header says these.
    shifted = stored.astype(np.int32) + (1 << 15) - (1 << (bits - 1))
    cv2.imwrite(
        str(path), shifted.astype(np.uint16), [cv2.IMWRITE_JPEG2000_COMPRESSION_X1000, 1000]
    )
    content = bytearray(path.read_bytes())
    content[content.index(b"ihdr") + 14] = bits - 1
    sizes = content.index(b"\xff\x4f\xff\x51") + 42
    content[sizes : sizes + 3 * channels : 3] = bytes([bits - 1]) * channels
    path.write_bytes(content)
    return levels


DEEP = [("avif", 10), ("avif", 12), ("jp2", 10), ("jp2", 12), ("jp2", 16)]


@pytest.mark.parametrize(("suffix", "bits"), DEEP)
@pytest.mark.parametrize("channels", [1, 3])
def test_10_to_16_bits_of_avif_and_jpeg_2000_stay(tmp_path, suffix, bits, channels):
    if suffix == "avif" and channels == 1:
        pytest.skip("OpenCV writes no grey AVIF of more than 8 bits")
    levels = deep_picture(tmp_path / f"a.{suffix}", bits, channels)
    photo = read_photo(tmp_path / f"a.{suffix}")
    expected = srgb_to_linear(levels / ((1 << bits) - 1.0)) * np.ones(3)
    np.testing.assert_allclose(photo.linear, expected, atol=5e-5)
    assert photo.warnings == ()


def test_alpha_of_a_deep_avif(tmp_path):
    levels = deep_picture(tmp_path / "a.avif", 10, 4) / 1023
    photo = read_photo(tmp_path / "a.avif")
    over_white = srgb_to_linear(levels[..., :3]) * levels[..., 3:] + 1 - levels[..., 3:]
    np.testing.assert_allclose(photo.linear, over_white, atol=2e-3)


def test_an_opencv_without_avif_says_how_many_bits_are_read(tmp_path, monkeypatch):
    levels = deep_picture(tmp_path / "a.avif", 12, 3)
    monkeypatch.setattr(cv2, "haveImageReader", lambda path: False)
    photo = read_photo(tmp_path / "a.avif")
    np.testing.assert_allclose(photo.linear, srgb_to_linear(levels / 4095), atol=1e-2)
    assert photo.warnings == (
        "Of the AVIF's 12 bits a channel 8 are read; OpenCV from 4.12 on reads all.",
    )


@pytest.mark.parametrize("white", [100, 255, 1023, 4095, 65535])
@pytest.mark.parametrize("kind", ["P5", "P6"])
def test_the_white_of_a_pnm_is_what_its_header_says(tmp_path, kind, white):
    encoded = picture() / 255 if kind == "P6" else picture()[..., 0] / 255
    levels = np.round(encoded * white).astype(">u2" if white > 255 else np.uint8)
    header = f"{kind}\n# 30 20 9\n30 20\n{white}\n".encode()
    (tmp_path / "a.pnm").write_bytes(header + levels.tobytes())
    expected = np.atleast_3d(srgb_to_linear(levels / white)) * np.ones(3)
    np.testing.assert_allclose(
        read_photo(tmp_path / "a.pnm").linear, expected, atol=2e-5 if white > 255 else 5e-3
    )
    # As a map, too.
    values = np.broadcast_to(np.atleast_3d(read_map(tmp_path / "a.pnm")), (20, 30, 3))
    np.testing.assert_allclose(values, np.atleast_3d(levels / white) * np.ones(3), atol=3e-3)


def test_a_grey_pfm_holds_light(tmp_path):
    light = picture()[..., 0].astype(np.float32) / 64
    (tmp_path / "a.pfm").write_bytes(b"Pf\n30 20\n-1.0\n" + light[::-1].tobytes())
    photo = read_photo(tmp_path / "a.pfm")
    assert photo.hdr
    np.testing.assert_allclose(photo.original[..., 1] * 2.0**-photo.stops, light, rtol=1e-6)


@pytest.mark.parametrize("bits", [4, 24])
def test_tiffs_of_packed_levels_are_refused_as_what_they_are(tmp_path, bits):
    tifffile.imwrite(tmp_path / "whole.tif", np.full((16, 16, 3), 9, np.uint8), photometric="rgb")
    content = bytearray((tmp_path / "whole.tif").read_bytes())
    # BitsPerSample of three channels lies outside of the directory.
    at = content.index(struct.pack("<3H", 8, 8, 8))
    content[at : at + 6] = struct.pack("<3H", bits, bits, bits)
    (tmp_path / "packed.tif").write_bytes(content + bytes(4096))
    with pytest.raises(InputError, match=f"{bits} bits") as refused:
        read_photo(tmp_path / "packed.tif")
    assert "damaged" not in str(refused.value) and "save it as plain" in str(refused.value)


def test_float_tiff_is_scene_linear(tmp_path):
    values = np.random.default_rng(0).random((12, 13, 3), np.float32) * 4
    tifffile.imwrite(tmp_path / "a.tiff", values, photometric="rgb")
    photo = read_photo(tmp_path / "a.tiff")
    np.testing.assert_array_equal(photo.linear * np.float32(2.0**-photo.stops), values)
    assert photo.hdr


@pytest.mark.parametrize("unit", [1e-4, 1, 4000])
def test_exr_of_any_unit_is_exposed_by_whole_stops_and_clipped_to_ten(tmp_path, unit):
    values = np.random.default_rng(0).random((40, 50, 3), np.float32) * np.float32(unit)
    values[0, :5] = 1e5 * unit  # a sun must not set the scale
    write_exr(tmp_path / "a.exr", values)
    photo = read_photo(tmp_path / "a.exr")
    assert photo.hdr and any("clipped" in warning for warning in photo.warnings)
    assert (
        any("stops" in warning for warning in photo.warnings) == (unit != 1) == (photo.stops != 0)
    )
    np.testing.assert_array_equal(
        photo.original * np.float32(2.0**-photo.stops), values
    )  # not a digit is lost
    np.testing.assert_array_equal(photo.linear, np.minimum(photo.original, 10))
    assert 0.63 < np.percentile(photo.linear.max(-1), 97) < 1.28


@pytest.mark.parametrize("unit", [1 / 300, 1, 300])
def test_transparent_parts_are_white_in_any_unit(tmp_path, unit):
    alpha = np.ones((20, 30, 1), np.float32)
    alpha[:, :12] = 0
    colour = (
        alpha * np.float32(unit) * np.linspace(0.1, 0.9, 600, dtype=np.float32).reshape(20, 30, 1)
    )
    pixels = np.concatenate([colour, colour, colour, alpha], -1)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGBA": pixels}).write(str(tmp_path / "a.exr"))
    photo = read_photo(tmp_path / "a.exr")
    np.testing.assert_array_equal(photo.linear[:, :12], 1)
    assert photo.hdr and 0.2 < np.median(photo.linear[:, 12:]) < 1 and exposed(photo) is photo
    np.testing.assert_array_equal(
        decode_photo(tmp_path / "a.exr").exposed(photo.stops), photo.original
    )


def test_a_photo_from_memory_is_exposed_and_one_pixel_at_one_is_no_clipping(tmp_path):
    values = np.random.default_rng(0).random((60, 70, 3), np.float32) * np.float32(0.01)
    photo = exposed(Photo(values, Camera(70, 60, 40.0), values, True))
    assert photo.stops == 7 and exposed(photo) is photo
    np.testing.assert_array_equal(photo.original, 128 * values)
    bright = np.clip(values * 128, 0, 1)
    bright[0, 0] = 500
    assert (
        exposed(Photo(bright, Camera(70, 60, 40.0), bright, True)).linear.max() == 10
    )  # without any stops
    ordinary = Photo(values, Camera(70, 60, 40.0), values)
    assert exposed(ordinary) is ordinary
    values[0, 0] = 1
    write_exr(tmp_path / "a.exr", values)
    assert read_photo(tmp_path / "a.exr").stops == 7


def test_an_exr_clipped_at_one_is_not_called_hdr_and_grey_is_spread(tmp_path):
    values = np.random.default_rng(0).random((12, 13), np.float32)
    values[0, 0] = -0.25
    write_exr(tmp_path / "dim.exr", values)
    assert read_photo(tmp_path / "dim.exr").hdr
    values[5] = 1
    write_exr(tmp_path / "a.exr", values)
    photo = read_photo(tmp_path / "a.exr")
    assert not photo.hdr and photo.linear[0, 0, 0] == 0
    np.testing.assert_array_equal(photo.linear[1:, :, 1], values[1:])
    assert photo.warnings == ("Negative values are set to 0.",)


def test_radiance_hdr_against_the_definition(tmp_path):
    """Ward's RGBE: value = mantissa * 2**(exponent - 136), written flat by hand."""
    rng = np.random.default_rng(0)
    rgbe = rng.integers(128, 256, (8, 9, 4)).astype(np.uint8)
    rgbe[..., 3] = rng.integers(126, 134, (8, 9))
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 9\n"
    (tmp_path / "a.hdr").write_bytes(header + rgbe.tobytes())
    photo = read_photo(tmp_path / "a.hdr")
    expected = rgbe[..., :3] * 2.0 ** (rgbe[..., 3:].astype(float) - 136)
    np.testing.assert_allclose(photo.original * 2.0**-photo.stops, expected, rtol=0.005)
    assert photo.hdr


@pytest.mark.parametrize("depth", [8, 16])
def test_alpha_is_laid_over_white(tmp_path, depth):
    top = 255 if depth == 8 else 65535
    pixels = np.zeros((10, 10, 4), np.uint8 if depth == 8 else np.uint16)
    pixels[..., 1], pixels[..., 3] = top, top
    pixels[:5, :, 3] = 0
    pixels[5, :, 3] = round(top * 0.4)
    cv2.imwrite(str(tmp_path / "a.png"), pixels)
    photo = read_photo(tmp_path / "a.png")
    np.testing.assert_array_equal(photo.linear[:5], 1)
    np.testing.assert_allclose(photo.linear[5], np.tile([0.6, 1, 0.6], (10, 1)), atol=1e-5)
    np.testing.assert_allclose(photo.linear[6:], np.tile([0, 1, 0], (4, 10, 1)), atol=1e-6)
    assert photo.warnings == ("Transparent parts are laid over white.",)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize(
    ("suffix", "depth"),
    [
        ("png", np.uint8),
        ("png", np.uint16),
        ("tif", np.uint8),
        ("tif", np.uint16),
        ("tif", np.float32),
    ],
)
def test_orientation_turns_the_photo_upright(tmp_path, orientation, suffix, depth):
    """As Pillow turns it."""
    pixels = picture(10, 14)
    exif = Image.Exif()
    exif[274] = orientation
    save(tmp_path / "b.png", pixels, exif=exif)
    upright = np.asarray(ImageOps.exif_transpose(Image.open(tmp_path / "b.png")))
    file = tmp_path / f"a.{suffix}"
    values = pixels.astype(depth) * depth(257 if depth == np.uint16 else 1)
    if suffix == "tif":
        tifffile.imwrite(
            file, values, photometric="rgb", extratags=[(274, "H", 1, orientation, True)]
        )
    else:
        cv2.imwrite(str(file), values[..., ::-1])
        data = file.read_bytes()
        block = exif.tobytes().removeprefix(b"Exif\0\0")
        file.write_bytes(data[:33] + chunk(b"eXIf", block) + data[33:])
    expected = upright.astype(np.float32) if depth == np.float32 else srgb_to_linear(upright)
    np.testing.assert_allclose(decode_photo(file).linear, expected, atol=1e-6)


def test_shrinking_averages_light_not_codes(tmp_path):
    board = np.repeat((np.indices((64, 128)).sum(0) % 2 * 255)[..., None], 3, -1).astype(np.uint8)
    board[:, :64] //= 2
    photo = read_photo(save(tmp_path / "b.png", board), size=32)
    assert photo.linear.shape == (16, 32, 3) and photo.original.shape == (64, 128, 3)
    np.testing.assert_allclose(photo.linear[:, 16:], 0.5, atol=1e-5)
    np.testing.assert_allclose(photo.linear.mean(), photo.original.mean(), rtol=1e-5)


def test_wide_gamut_profile_is_converted(tmp_path):
    """A profile with swapped primaries and gamma 2 must swap the channels back and undo that gamma."""
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    assert matrix_profile(srgb).is_srgb
    swapped = bytearray(srgb)
    count = struct.unpack_from(">I", swapped, 128)[0]
    entries = {bytes(swapped[132 + 12 * i : 136 + 12 * i]): 132 + 12 * i for i in range(count)}
    red = entries[b"rXYZ"]
    green = entries[b"gXYZ"]
    swapped[red : red + 4], swapped[green : green + 4] = b"gXYZ", b"rXYZ"
    pixels = picture()
    photo = read_photo(save(tmp_path / "a.png", pixels, icc_profile=bytes(swapped)))
    np.testing.assert_allclose(photo.linear, srgb_to_linear(pixels[..., [1, 0, 2]]), atol=3e-3)
    plain = read_photo(save(tmp_path / "b.png", pixels, icc_profile=srgb))
    np.testing.assert_array_equal(plain.linear, read_photo(save(tmp_path / "c.png", pixels)).linear)


def test_matrix_profile_agrees_with_lcms(real_data):
    """Our float evaluation against LittleCMS on a real file with a display profile."""
    path = real_data("data/odd_inputs/rgba_concert.tiff")
    photo = read_photo(path, size=1024)
    image = Image.open(path)
    source = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"]))
    twin = ImageCms.profileToProfile(image.convert("RGB"), source, ImageCms.createProfile("sRGB"))
    assert np.abs(linear_to_srgb(photo.linear) - np.asarray(twin) / 255).mean() < 0.004


def test_fov_option_wins_and_must_make_sense(tmp_path):
    path = save(tmp_path / "a.png", picture())
    photo = read_photo(path, fov=71.5)
    assert (photo.camera.fov, photo.fov_source) == (71.5, "option")
    assert read_photo(path, fov="71.5").camera.fov == 71.5
    for bad in (0, 1, 170, -5, float("nan"), "wide"):
        with pytest.raises(InputError, match="field of view"):
            read_photo(path, fov=bad)
    for bad in (7, 9000, 2.5, True):
        with pytest.raises(InputError, match="working size"):
            read_photo(path, size=bad)


def _cut(path, fraction):
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * fraction)])
    return path


def _bad_files(folder):
    """(path, words that the message must contain)."""
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
    cut = "damaged or truncated"
    for name, content, words in (
        ("empty.jpg", b"", "is empty"),
        ("letter.jpg", b"Dear photographer, " * 20, "not an image"),
        ("stub.exr", b"\x76\x2f\x31\x01", "damaged|readable"),
        ("stub.hdr", b"#?RADIANCE\n\n-Y 64 +X 64\n1234", cut),
        ("huge.png", png_header(20000, 20000), "400 megapixels; the limit is 200"),
    ):
        (folder / name).write_bytes(content)
        yield folder / name, words
    yield folder / "nothing.jpg", "no picture at"
    yield folder, "is a folder"
    for suffix in ("jpg", "png", "webp", "tiff"):
        yield _cut(save(folder / f"cut.{suffix}", noise), 0.6), cut
    cv2.imwrite(str(folder / "cut16.png"), noise.astype(np.uint16) * 257)
    yield _cut(folder / "cut16.png", 0.6), cut
    write_exr(folder / "cut.exr", noise / np.float32(255))
    yield _cut(folder / "cut.exr", 0.6), "damaged|readable"
    for name, pixels, words in (
        ("1.png", noise[:1, :1], "1 x 1 pixels"),
        ("thin.png", noise[:3], "64 x 3 pixels"),
        ("ribbon.png", np.zeros((100, 20000, 3), np.uint8), "20000 x 100.*8:1"),
        ("black.png", noise * 0, "entirely black"),
        ("flat.png", noise * 0 + 90, "one flat colour"),
    ):
        yield save(folder / name, pixels), words
    for value in (np.nan, np.inf):
        values = noise.astype(np.float32)
        values[5, 7] = value
        write_exr(folder / f"{value}.exr", values)
        yield folder / f"{value}.exr", "column 7, row 5"


def test_bad_files_get_one_clear_sentence(tmp_path):
    for path, words in _bad_files(tmp_path):
        with pytest.raises(InputError, match=words) as caught:
            read_photo(path)
        message = str(caught.value)
        assert "\n" not in message and message.endswith(".") and path.name in message


def test_odd_inputs_all_work(real_data):
    folder = real_data("data/odd_inputs")
    shapes = {path.name: read_photo(path, size=128).linear.shape for path in folder.iterdir()}
    assert len(shapes) == 10
    assert shapes["orientation6_streetlamp_exif.jpg"] == (128, 96, 3)
    assert shapes["orientation8_landscape.jpg"] == (96, 128, 3)
    assert any(
        "360" in w for w in read_photo(folder / "panorama_braunschweig_equirect.jpg").warnings
    )


def write_dng(path, *tags, orientation=1):
    """A grey ramp of 96 x 64 in a colour filter array; returns its values."""
    ramp = np.broadcast_to(np.linspace(2000, 60000, 96), (64, 96))
    rational = [
        part for row in XYZ_TO_SRGB for value in row for part in (round(value * 10000), 10000)
    ]
    camera = [
        (274, "H", 1, orientation),
        (271, "s", 0, "Test"),
        (272, "s", 0, "Camera"),
        (33421, "H", 2, (2, 2)),
        (33422, "B", 4, bytes([0, 1, 1, 2])),
        (41989, "H", 1, 50),
        (50706, "B", 4, bytes([1, 4, 0, 0])),
        (50708, "s", 0, "Test Camera"),
        (50717, "I", 1, 65535),
        (50721, "2i", 9, rational),
        (50728, "2I", 3, [1] * 6),
        (50778, "H", 1, 21),
    ]
    extra = [(*tag, True) for tag in (*camera, *tags)]
    tifffile.imwrite(path, ramp.astype(np.uint16), photometric=32803, extratags=extra)
    return ramp / 65535


def test_camera_raw_is_linear_and_knows_its_lens(tmp_path):
    """A grey ramp in a DNG's colour filter array comes back as the same grey ramp, up to one exposure factor."""
    pytest.importorskip("rawpy", reason="needs rawpy")
    ramp = write_dng(tmp_path / "a.dng")
    photo = read_photo(tmp_path / "a.dng")
    middle = photo.linear[8:-8, 8:-8]
    ratio = middle.mean(-1) / ramp[8:-8, 8:-8]
    assert photo.linear.shape == (64, 96, 3) and np.ptp(middle, axis=-1).max() < 0.02
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.02)
    assert photo.fov_source == "exif" and photo.camera.fov == pytest.approx(39.598, abs=0.01)


ACTIVE_AREA = (50829, "I", 4, (4, 8, 60, 88))
"""Top, left, bottom, right."""


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize(("active", "left", "top"), [((), 10, 4), ((ACTIVE_AREA,), 18, 8)])
def test_the_default_crop_of_a_dng(tmp_path, active, left, top, orientation):
    """DefaultCropOrigin counts from the active area; the picture that is turned is cut on the sides that were meant."""
    pytest.importorskip("rawpy", reason="needs rawpy")
    crop = (50719, "I", 2, (10, 4)), (50720, "I", 2, (60, 40))
    ramp = write_dng(tmp_path / "a.dng", *crop, *active, orientation=orientation)
    found = read_photo(tmp_path / "a.dng").original.mean(-1)
    upright = {1: found, 3: found[::-1, ::-1], 6: np.rot90(found, 1), 8: np.rot90(found, -1)}[
        orientation
    ]
    assert upright.shape == (40, 60)
    expected = ramp[top : top + 40, left : left + 60]
    ratio = (upright / expected)[4:-4, 4:-4]
    np.testing.assert_allclose(ratio, np.median(ratio), rtol=0.03)


@pytest.mark.parametrize("suffix", [".jfif", ".jp2", ".hif", ".tga", ".ppm"])
def test_more_names_of_photos(tmp_path, suffix):
    register_heif_opener()
    assert suffix in SUFFIXES
    pixels = picture(64, 96)
    kind = {".jfif": "JPEG", ".jp2": "JPEG2000", ".hif": "HEIF"}.get(suffix)
    Image.fromarray(pixels).save(tmp_path / f"a{suffix}", kind)
    photo = read_photo(tmp_path / f"a{suffix}")
    assert np.abs(linear_to_srgb(photo.linear) - pixels / 255).mean() < 0.02


@pytest.mark.parametrize("mode", ["L", "RGBA", "CMYK", "RGB"])
def test_turned_tiffs_are_upright(tmp_path, mode):
    """Pillow maps some of them into memory, and gets the rows of turned ones wrong."""
    pixels = np.random.default_rng(0).integers(0, 256, (20, 30, len(mode)), np.uint8)
    pixels[..., 3:] = 255 if mode == "RGBA" else pixels[..., 3:]
    image = Image.fromarray(pixels[..., 0] if mode == "L" else pixels, mode)
    image.save(tmp_path / "a.tif")
    image.save(tmp_path / "b.tif", tiffinfo={274: 6})
    plain, turned = (decode_photo(tmp_path / name).linear for name in ("a.tif", "b.tif"))
    assert turned.shape == (30, 20, 3)
    np.testing.assert_array_equal(turned, plain.swapaxes(0, 1)[:, ::-1])
