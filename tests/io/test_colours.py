"""Colours that a file states, by anything: each gives the same four linear colours."""

import io
import struct

import cv2
import numpy as np
import pytest
import tifffile
from made_colours import (
    COLOURS,
    TO_2020,
    TO_ADOBE,
    TO_P3,
    assert_right,
    hlg,
    levels,
    medians,
    pq,
    quadrants,
    srgb,
)
from made_png import chunk
from PIL import Image, ImageCms
from pillow_heif import from_bytes

from materialist.errors import InputError
from materialist.io.colour_space import (
    ADOBE_RGB,
    CIE_XYZ,
    DISPLAY_P3,
    REC709,
    REC2020,
    rgb_to_xyz,
    to_rec709,
)
from materialist.io.decode import decode
from materialist.io.photo import read_photo

REPORTED = "data/reported"


def png(path, pixels, *chunks):
    """A PNG of 8 or 16 bits with chunks before its pixels."""
    data = cv2.imencode(".png", pixels[..., ::-1] if pixels.ndim == 3 else pixels)[1].tobytes()
    path.write_bytes(
        data[:33] + b"".join(chunk(kind, content) for kind, content in chunks) + data[33:]
    )
    return path


def gama(gamma):
    return b"gAMA", struct.pack(">I", round(gamma * 1e5))


def chrm(primaries):
    red_to_blue = primaries[:6]
    white = primaries[6:]
    return b"cHRM", struct.pack(">8I", *(round(value * 1e5) for value in (*white, *red_to_blue)))


def test_matrices_are_the_published_ones():
    np.testing.assert_allclose(np.linalg.inv(to_rec709(REC2020)), TO_2020, atol=1e-4)
    np.testing.assert_allclose(np.linalg.inv(to_rec709(DISPLAY_P3)), TO_P3, atol=3e-4)
    np.testing.assert_allclose(np.linalg.inv(to_rec709(ADOBE_RGB)), TO_ADOBE, atol=1e-4)
    np.testing.assert_allclose(to_rec709(REC709), np.eye(3), atol=1e-12)
    np.testing.assert_allclose(to_rec709(CIE_XYZ) @ np.ones(3), 1, atol=1e-9)  # white stays white
    with pytest.raises(ValueError, match="span no colours"):
        rgb_to_xyz((0.3, 0.3) * 4)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize(
    ("encode", "chunks"),
    [
        (lambda: srgb(quadrants(TO_P3)), [(b"cICP", bytes([12, 13, 0, 1]))]),
        (
            lambda: srgb(quadrants(TO_2020)),
            [(b"cICP", bytes([9, 13, 0, 1])), gama(1 / 2.2), chrm(ADOBE_RGB)],
        ),
        (lambda: (16 + 219 * srgb(quadrants(TO_P3))) / 255, [(b"cICP", bytes([12, 13, 0, 0]))]),
        (lambda: quadrants() ** (1 / 1.8), [gama(1 / 1.8)]),
        (lambda: quadrants(), [gama(1)]),
        (lambda: quadrants(TO_ADOBE) ** (1 / 2.2), [gama(1 / 2.2), chrm(ADOBE_RGB)]),
        (lambda: srgb(quadrants(TO_P3)), [chrm(DISPLAY_P3)]),
        (lambda: srgb(quadrants()), [(b"sRGB", b"\0"), gama(1), chrm(ADOBE_RGB)]),
        (lambda: srgb(quadrants()), [gama(1 / 2.2), chrm(REC709)]),
    ],
    ids=[
        "cicp-p3",
        "cicp-first",
        "cicp-narrow",
        "gamma-1.8",
        "linear",
        "adobe",
        "chrm",
        "srgb-first",
        "srgb-twice",
    ],
)
def test_chunks_of_png(tmp_path, encode, chunks, dtype):
    photo = read_photo(png(tmp_path / "a.png", levels(encode(), dtype), *chunks))
    assert_right(photo)
    assert not photo.hdr and photo.warnings == ()


@pytest.mark.parametrize(("code", "curve", "name"), [(16, pq, "PQ"), (18, hlg, "HLG")])
def test_hdr_png_is_light_and_says_so(tmp_path, code, curve, name):
    bright = quadrants(TO_2020)
    bright[:4] = 3.0  # above white
    photo = read_photo(
        png(tmp_path / "a.png", levels(curve(bright), np.uint16), (b"cICP", bytes([9, code, 0, 1])))
    )
    assert_right(photo)
    assert photo.hdr and any(name in warning for warning in photo.warnings)
    np.testing.assert_allclose(photo.original[0] * 2.0**-photo.stops, 3, rtol=0.01)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ((b"gAMA", struct.pack(">I", 0)), "cannot be used"),
        ((b"cHRM", struct.pack(">8I", *[30000] * 8)), "span no colours"),
        ((b"cICP", bytes([3, 99, 0, 1])), "not all known"),
    ],
)
def test_stated_colours_that_make_no_sense_are_told_of(tmp_path, bad, words):
    photo = read_photo(png(tmp_path / "a.png", levels(srgb(quadrants())), bad))
    assert_right(photo)
    assert any(words in warning for warning in photo.warnings)


@pytest.mark.parametrize(
    ("name", "encode", "codes", "is_hdr"),
    [
        ("p3.heic", lambda: srgb(quadrants(TO_P3)), (12, 13, 6), False),
        ("pq.heic", lambda: pq(quadrants(TO_2020)), (9, 16, 9), True),
        ("hlg.heic", lambda: hlg(quadrants(TO_2020)), (9, 18, 9), True),
        ("srgb.heic", lambda: srgb(quadrants()), (1, 13, 6), False),
    ],
)
@pytest.mark.parametrize("bits", [8, 10])
def test_nclx_of_heic(tmp_path, name, encode, codes, is_hdr, bits):
    pixels = levels(encode(), np.uint8 if bits == 8 else np.uint16)
    image = from_bytes("RGB" if bits == 8 else "RGB;16", pixels.shape[1::-1], pixels.tobytes())
    keys = ("color_primaries", "transfer_characteristics", "matrix_coefficients")
    image.save(tmp_path / name, quality=-1, chroma=444, **dict(zip(keys, codes)))
    photo = read_photo(tmp_path / name)
    assert_right(photo, 0.02)
    assert (
        photo.hdr == is_hdr and any("is read as" in warning for warning in photo.warnings) == is_hdr
    )


@pytest.mark.parametrize("codes", [(1, 1), (6, 6), (5, 6)])
def test_the_codes_of_video_are_srgb_in_a_still(tmp_path, codes):
    photo = read_photo(
        png(tmp_path / "a.png", levels(srgb(quadrants())), (b"cICP", bytes([*codes, 0, 1])))
    )
    assert_right(photo)
    assert any("taken as sRGB" in warning for warning in photo.warnings)


@pytest.mark.parametrize(
    ("codes", "encode"),
    [((12, 13), lambda: srgb(quadrants(TO_P3))), ((9, 16), lambda: pq(quadrants(TO_2020)))],
)
def test_nclx_of_avif(tmp_path, codes, encode):
    """Pillow writes Rec.709 and sRGB; the two codes are put in their place."""
    Image.fromarray(levels(encode())).save(tmp_path / "a.avif", quality=100, subsampling="4:4:4")
    data = (tmp_path / "a.avif").read_bytes()
    at = data.index(b"colrnclx") + 8
    (tmp_path / "a.avif").write_bytes(data[:at] + struct.pack(">HH", *codes) + data[at + 4 :])
    assert_right(read_photo(tmp_path / "a.avif"), 0.04)


def adobe_jpeg(path, exif):
    encoded = quadrants(TO_ADOBE) ** (256 / 563)
    Image.fromarray(levels(encoded)).save(path, quality=100, subsampling=0, exif=exif)
    return path


def test_adobe_rgb_by_exif(tmp_path):
    """DCF's option file: R03 with an uncalibrated colour space; and ColorSpace 2, which some cameras write."""
    for name, colour_space, index in (("r03.jpg", 65535, "R03"), ("two.jpg", 2, None)):
        exif = Image.Exif()
        exif.get_ifd(34665)[40961] = colour_space
        if index:
            exif.get_ifd(34665)[40965] = {1: index}
        assert_right(read_photo(adobe_jpeg(tmp_path / name, exif)), 0.02)


def test_exif_that_names_no_space_gives_a_note_and_srgb_gives_none(tmp_path):
    for colour_space, notes in ((65535, 1), (1, 0)):
        exif = Image.Exif()
        exif.get_ifd(34665)[40961] = colour_space
        Image.fromarray(levels(srgb(quadrants()))).save(
            tmp_path / "a.jpg", quality=100, subsampling=0, exif=exif
        )
        photo = read_photo(tmp_path / "a.jpg")
        assert_right(photo, 0.02)
        assert len(photo.warnings) == notes


def test_primaries_of_exif(tmp_path):
    exif = Image.Exif()
    exif[318], exif[319] = DISPLAY_P3[6:], DISPLAY_P3[:6]
    Image.fromarray(levels(srgb(quadrants(TO_P3)))).save(tmp_path / "a.tif", exif=exif)
    assert_right(read_photo(tmp_path / "a.tif"))


def icc(primaries, curve):
    """A matrix profile as darktable writes it: D50 colorants and one curve."""
    to_d50 = np.linalg.inv(
        np.array(
            [
                [0.4360747, 0.3850649, 0.1430804],
                [0.2225045, 0.7168786, 0.0606169],
                [0.0139322, 0.0971045, 0.7141733],
            ]
        )
    )
    colorants = np.linalg.inv(to_d50) @ to_rec709(primaries)
    tags = {
        name: b"XYZ \0\0\0\0" + struct.pack(">3i", *np.round(colorants[:, k] * 65536).astype(int))
        for k, name in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))
    }
    tags |= dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve)
    table = b""
    body = b""
    for name, data in tags.items():
        table += name + struct.pack(">II", 132 + 12 * len(tags) + len(body), len(data))
        body += data + b"\0" * (-len(data) % 4)
    head = bytearray(128)
    head[16:24] = b"RGB XYZ "
    return bytes(head) + struct.pack(">I", len(tags)) + table + body


LINEAR = b"curv\0\0\0\0" + struct.pack(">I", 0)
SRGB_PARAMETERS = (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045)
SRGB = b"para\0\0\0\0" + struct.pack(
    ">HH5i", 3, 0, *(round(value * 65536) for value in SRGB_PARAMETERS)
)


@pytest.mark.parametrize(
    ("profile", "encode"),
    [
        (icc(REC2020, LINEAR), lambda: quadrants(TO_2020) * 4),
        (icc(REC709, SRGB), lambda: srgb(quadrants())),
        (icc(DISPLAY_P3, SRGB), lambda: srgb(quadrants(TO_P3))),
    ],
    ids=["linear-2020", "srgb", "p3"],
)
def test_profile_of_a_float_tiff(tmp_path, profile, encode):
    values = encode().astype(np.float32)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="rgb", iccprofile=profile)
    photo = read_photo(tmp_path / "a.tif")
    scale = 4 if values.max() > 1 else 1
    np.testing.assert_allclose(medians(photo) / scale, COLOURS, atol=0.01)


def test_a_table_profile_of_a_float_tiff_gives_a_note(tmp_path):
    lab = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    values = quadrants().astype(np.float32)
    tifffile.imwrite(tmp_path / "a.tif", values, photometric="rgb", iccprofile=lab)
    assert any("taken as linear" in warning for warning in read_photo(tmp_path / "a.tif").warnings)


def test_grey_profiles_of_any_depth(tmp_path):
    """Gamma 1.8 at 8 and 16 bits."""
    profile = bytearray(icc(REC709, LINEAR))
    profile[16:20] = b"GRAY"
    curve = b"curv\0\0\0\0" + struct.pack(">IH", 1, round(1.8 * 256)) + b"\0\0"
    head = bytes(profile[:128]) + struct.pack(">I4sII", 1, b"kTRC", 144, len(curve)) + curve
    ramp = np.tile(np.linspace(0.1, 0.9, 40), (25, 1))
    for dtype in (np.uint8, np.uint16):
        tifffile.imwrite(
            tmp_path / "a.tif", levels(ramp, dtype), photometric="minisblack", iccprofile=head
        )
        photo = read_photo(tmp_path / "a.tif")
        np.testing.assert_allclose(photo.linear[..., 1], ramp**1.8, atol=0.004)
        assert photo.warnings == ()


@pytest.mark.parametrize("kind", ["cielab", "icclab"])
@pytest.mark.parametrize("compression", [None, "zlib"])
def test_cielab_of_16_bits(tmp_path, kind, compression):
    from skimage.color import rgb2lab

    lab = rgb2lab(srgb(quadrants()), illuminant="D65")  # about what Bradford makes of it under D50
    if kind == "cielab":
        lightness = np.round(lab[..., :1] / 100 * 65535).astype(np.uint16)
        stored = np.concatenate(
            [lightness, np.round(lab[..., 1:] * 256).astype(np.int16).view(np.uint16)], -1
        )
    else:
        stored = np.round(lab * [652.8, 256, 256] + [0, 32768, 32768]).astype(np.uint16)
    tifffile.imwrite(tmp_path / "a.tif", stored, photometric=kind, compression=compression)
    photo = read_photo(tmp_path / "a.tif")
    assert_right(photo, 0.05)
    np.testing.assert_allclose(medians(photo)[3], 0.216, atol=2e-3)  # grey is neutral


@pytest.mark.parametrize("meaning", ["separated", "cfa", "ycbcr"])
def test_deep_tiffs_that_are_neither_grey_nor_rgb_are_refused(tmp_path, meaning):
    code = {"separated": 5, "cfa": 32803, "ycbcr": 6}[meaning]
    channels = 4 if meaning == "separated" else 3
    pixels = np.random.default_rng(0).integers(0, 65536, (20, 30, channels)).astype(np.uint16)
    tifffile.imwrite(
        tmp_path / "a.tif", pixels, photometric="rgb", extrasamples=["unspecified"] * (channels - 3)
    )
    with tifffile.TiffFile(tmp_path / "a.tif", mode="r+b") as file:
        file.pages[0].tags["PhotometricInterpretation"].overwrite(code)
    with pytest.raises(InputError, match="neither grey nor RGB"):
        read_photo(tmp_path / "a.tif")


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_fourth_channel_that_is_no_alpha_is_left_out(tmp_path, dtype):
    colour = quadrants() if dtype == np.float32 else levels(srgb(quadrants()), dtype)
    fourth = np.zeros((64, 96, 1)) + (0.5 if dtype == np.float32 else 7)
    pixels = np.concatenate([colour, fourth], -1).astype(dtype)
    tifffile.imwrite(tmp_path / "a.tif", pixels, photometric="rgb", extrasamples=["unspecified"])
    photo = read_photo(tmp_path / "a.tif")
    assert_right(photo, 0.01)
    assert any("no transparency" in warning for warning in photo.warnings)


def test_a_second_channel_of_a_deep_grey_tiff_is_told_of(tmp_path):
    grey = levels(srgb(quadrants()), np.uint16)[..., :1]
    pixels = np.concatenate([grey, grey * 0 + 9], -1)
    tifffile.imwrite(
        tmp_path / "a.tif",
        pixels,
        photometric="minisblack",
        extrasamples=["unspecified"],
        planarconfig="contig",
    )
    photo = read_photo(tmp_path / "a.tif")
    np.testing.assert_allclose(medians(photo), np.tile(COLOURS[:, :1], 3), atol=0.01)
    assert any("transparency" in warning for warning in photo.warnings)


@pytest.mark.parametrize("colours", [1, 3])
def test_a_transparent_colour_of_a_16_bit_png(tmp_path, colours):
    pixels = levels(srgb(quadrants()), np.uint16)[..., 3 - colours :]
    clear = pixels[-1, 0]
    path = png(
        tmp_path / "a.png",
        pixels if colours == 3 else pixels[..., 0],
        (b"tRNS", clear.astype(">u2").tobytes()),
    )
    photo = read_photo(path)
    np.testing.assert_array_equal(photo.original[40:, :40], 1)
    assert photo.original[:20].max() < 0.99 and photo.warnings == (
        "Transparent parts are laid over white.",
    )


def test_the_profile_of_a_jpeg_2000(tmp_path):
    Image.fromarray(levels(srgb(quadrants(TO_P3)))).save(tmp_path / "plain.jp2")
    data = (tmp_path / "plain.jp2").read_bytes()
    profile = icc(DISPLAY_P3, SRGB)
    start = data.index(b"colr") - 4
    (size,) = struct.unpack_from(">I", data, start)
    box = b"colr\2\0\0" + profile
    box = struct.pack(">I", 4 + len(box)) + box
    header = data.index(b"jp2h") - 4
    (header_size,) = struct.unpack_from(">I", data, header)
    grown = struct.pack(">I", header_size + len(box) - size)
    (tmp_path / "a.jp2").write_bytes(
        data[:header] + grown + data[header + 4 : start] + box + data[start + size :]
    )
    assert_right(read_photo(tmp_path / "a.jp2"), 0.01)


REPORTED_FILES = [
    ("heif_avif_nclx", 0.04),
    ("png_colour_chunks", 0.015),
    ("jpg_dcf_adobergb", 0.02),
    ("tif_float_icc", 0.01),
    ("tif_lab16", 0.05),
    ("tif_16_fourth_channel", 0.01),
    ("exr_chromaticities", 0.01),
    ("exr_luminance_chroma", 0.02),
    ("exr_which_layer", 0.01),
    ("exr_windows", 0.01),
    ("hdr_primaries", 0.02),
    ("hdr_readonly_tmp", 0.02),
    ("batch_names", 0.02),
    ("jpg_no_eoi", 0.012),
]


@pytest.mark.parametrize(("folder", "tolerance"), REPORTED_FILES)
def test_reported_files(real_data, folder, tolerance):
    for path in sorted(real_data(f"{REPORTED}/{folder}").iterdir()):
        if path.name != "README":
            photo = read_photo(path)
            assert photo.original.shape == (64, 96, 3), path.name
            assert_right(photo, tolerance)


def test_reported_transparent_grey(real_data):
    photo = read_photo(real_data(f"{REPORTED}/png_grey16_trns/grey16_trns.png"))
    np.testing.assert_array_equal(photo.original[40:, :40], 1)


def test_reported_crop_of_a_dng(real_data):
    pytest.importorskip("rawpy", reason="needs rawpy")
    photo = read_photo(real_data(f"{REPORTED}/dng_default_crop/r_crop35.dng"))
    assert photo.original.shape == (128, 192, 3) and photo.camera.fov == pytest.approx(
        39.6, abs=0.05
    )
    assert_right(photo, 0.02)


def test_primaries_of_a_float_tiff_without_a_profile(tmp_path):
    light = (2 * quadrants() @ TO_2020.T).astype(np.float32)
    rationals = [round(value * 100_000) for value in REC2020]
    pairs = [number for value in rationals for number in (value, 100_000)]
    tifffile.imwrite(
        tmp_path / "a.tif",
        light,
        photometric="rgb",
        extratags=[(319, 5, 6, pairs[:12], True), (318, 5, 2, pairs[12:], True)],
    )
    found = decode(tmp_path / "a.tif").linear
    assert found[0, 0] == pytest.approx(2 * quadrants()[0, 0], abs=1e-3)


def jpeg_of_noise(**options) -> bytes:
    noise = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    content = io.BytesIO()
    Image.fromarray(noise).save(content, "JPEG", quality=90, **options)
    return content.getvalue()


@pytest.mark.parametrize("progressive", (False, True))
def test_a_jpeg_without_its_end_marker_alone_is_whole(tmp_path, progressive):
    content = jpeg_of_noise(progressive=progressive)
    (tmp_path / "whole.jpg").write_bytes(content)
    (tmp_path / "a.jpg").write_bytes(content[:-2])
    found = decode(tmp_path / "a.jpg")
    np.testing.assert_array_equal(found.linear, decode(tmp_path / "whole.jpg").linear)
    assert found.warnings == ["The end marker of the JPEG is missing; all its pixels are there."]
    for missing in (6, 20, len(content) // 2):
        (tmp_path / "b.jpg").write_bytes(content[:-missing])
        with pytest.raises(InputError, match="damaged or truncated"):
            decode(tmp_path / "b.jpg")


def test_colours_of_a_bmp_give_a_note(tmp_path):
    Image.new("RGB", (16, 16), (200, 40, 40)).save(tmp_path / "plain.bmp")
    assert decode(tmp_path / "plain.bmp").warnings == []
    plain = (tmp_path / "plain.bmp").read_bytes()
    # --- A header of version 4 in the place of that of 40 bytes ---
    pixels = plain[54:]
    for kind, notes in ((bytes(4), 1), (b"BGRs", 0)):
        header = struct.pack("<I", 108) + plain[18:54] + bytes(16) + kind + bytes(48)
        offset = 14 + len(header)
        file = b"BM" + struct.pack("<IHHI", offset + len(pixels), 0, 0, offset) + header + pixels
        (tmp_path / "v4.bmp").write_bytes(file)
        assert len(decode(tmp_path / "v4.bmp").warnings) == notes
