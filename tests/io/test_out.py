"""Pictures out: formats, colours, profiles, EXIF, bits; what stays bit for bit, and what is said of the rest."""

import io
from dataclasses import replace

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from made_scene import make_scene
from PIL import Image, ImageCms
from tifffile import TiffFile

import materialist as mt
from materialist.color import srgb_levels
from materialist.errors import InputError, OutputError
from materialist.io import colour_space as spaces
from materialist.io.bitmap import turned_upright
from materialist.io.exr import read_exr
from materialist.io.icc import matrix_profile
from materialist.io.out.encode import _png
from materialist.io.out.exif import SOFTWARE
from materialist.io.out.icc import profile_of, srgb_profile
from materialist.io.out.tiff import tiff_bytes
from materialist.io.photo import read_photo

LEVELS = np.random.default_rng(1).integers(0, 256, (30, 41, 3)).astype(np.uint8)


def video_curve(encoded):
    """The inverse of BT.2020's: neither a power nor sRGB's, so a profile has samples of it."""
    return np.where(
        encoded < 0.081, encoded / 4.5, ((np.maximum(encoded, 0) + 0.099) / 1.099) ** (1 / 0.45)
    )


P3 = profile_of(spaces.space("Display P3", spaces.DISPLAY_P3, spaces.srgb_curve))
WIDE = profile_of(spaces.space("Rec. 2020", spaces.REC2020, video_curve))
ADOBE = profile_of(spaces.space("Adobe RGB", spaces.ADOBE_RGB, spaces.power_curve(563 / 256)))
EDITED = (slice(4, 9), slice(6, 12))
LEVELS[EDITED] = LEVELS[EDITED] // 8 + 100  # colours that every space has
LOSSLESS = [("png", {}), ("tif", {}), ("webp", {"quality": 100})]


def photo_of_levels(folder, levels=LEVELS, kind="png", **settings):
    Image.fromarray(levels).save(folder / f"photo.{kind}", **settings)
    return read_photo(folder / f"photo.{kind}")


def with_edit(photo, colour=(0.2, 0.1, 0.05)):
    picture = photo.original.copy()
    picture[EDITED] = colour
    return picture


def outside(levels, original):
    """Whether levels agree with the original's but where the edit is."""
    same = (levels == original).all(-1)
    same[EDITED] = True
    return bool(same.all())


@pytest.mark.parametrize(("kind", "settings"), LOSSLESS)
@pytest.mark.parametrize("profile", [None, P3, ADOBE, WIDE], ids=["srgb", "p3", "adobe", "rec2020"])
def test_lossless_formats_keep_the_photos_own_levels_and_colours(kind, settings, profile, tmp_path):
    photo = photo_of_levels(tmp_path, icc_profile=profile)
    picture = with_edit(photo)
    assert mt.save_image(tmp_path / f"out.{kind}", picture, photo, **settings) == ()
    image = Image.open(tmp_path / f"out.{kind}")
    assert outside(np.asarray(image), LEVELS)
    assert image.info["icc_profile"] == (profile or srgb_profile())
    again = read_photo(tmp_path / f"out.{kind}").original
    assert np.array_equal(again[12:], photo.original[12:])
    step = 0.006 if profile else 0.003  # half a level of the brightest of these colours
    assert np.abs(again[EDITED] - picture[EDITED]).max() < step


@pytest.mark.parametrize("kind", ["png", "tif"])
@pytest.mark.parametrize("profile", [None, P3, ADOBE], ids=["srgb", "p3", "adobe"])
def test_sixteen_bits_stay_sixteen(kind, profile, tmp_path):
    deep = np.random.default_rng(2).integers(0, 65536, (30, 41, 3)).astype(np.uint16)
    deep[0] //= 512  # the darkest levels
    deep[EDITED] = deep[EDITED] // 8 + 25_000
    (tmp_path / "a.png").write_bytes(cv2.imencode(".png", deep[..., ::-1])[1].tobytes())
    first = read_photo(tmp_path / "a.png")
    if profile:
        mt.save_image(tmp_path / "b.png", first.original, first)
        content = (tmp_path / "b.png").read_bytes()
        start = content.index(b"iCCP") - 4
        end = content.index(b"eXIf") - 4
        from materialist.io.out.encode import _chunk, zlib

        chunk = _chunk(b"iCCP", b"profile\0\0" + zlib.compress(profile))
        (tmp_path / "a.png").write_bytes(content[:start] + chunk + content[end:])
        first = read_photo(tmp_path / "a.png")
    mt.save_image(tmp_path / f"out.{kind}", with_edit(first), first)
    back = cv2.imread(str(tmp_path / f"out.{kind}"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert back.dtype == np.uint16 and outside(back, deep)
    again = read_photo(tmp_path / f"out.{kind}").original
    assert np.array_equal(again[12:], first.original[12:])
    assert np.abs(again[EDITED] - with_edit(first)[EDITED]).max() < 2e-5
    mt.save_image(tmp_path / f"eight.{kind}", first.original, first, bits=8)
    assert cv2.imread(str(tmp_path / f"eight.{kind}"), cv2.IMREAD_UNCHANGED).dtype == np.uint8


@pytest.mark.parametrize(
    ("kind", "quality", "worst"), [("jpg", 95, 12), ("webp", 90, 25), ("avif", 90, 25)]
)
def test_lossy_formats_take_a_quality(kind, quality, worst, tmp_path):
    ramp = cv2.resize(
        np.random.default_rng(3).integers(0, 256, (5, 6, 3)).astype(np.uint8), (96, 80)
    )
    photo = photo_of_levels(tmp_path, ramp, icc_profile=P3)
    for name, value in (("good", quality), ("bad", 10)):
        mt.save_image(tmp_path / f"{name}.{kind}", photo.original, photo, quality=value)
    image = Image.open(tmp_path / f"good.{kind}")
    assert (
        np.abs(np.asarray(image, np.int16) - ramp).max() <= worst
        and image.info["icc_profile"] == P3
    )
    assert (tmp_path / f"bad.{kind}").stat().st_size < (tmp_path / f"good.{kind}").stat().st_size


def test_colours_beyond_rec709_fade_with_what_an_edit_darkens(tmp_path):
    pure = np.zeros((16, 16, 3), np.uint8)
    pure[:, 8:] = 128
    pure[:, :8, 1] = 255  # a green that sRGB lacks
    photo = photo_of_levels(tmp_path, pure, icc_profile=P3)
    halved = photo.original * np.float32(0.5)
    halved[8:] = (0.4, 0.1, 0.1)  # another colour
    mt.save_image(tmp_path / "out.png", halved, photo)
    out = np.asarray(Image.open(tmp_path / "out.png"))
    assert (out[:8, :8] == [0, srgb_levels(np.float32([0.5]))[0], 0]).all()
    back = matrix_profile(P3).linear(out)
    assert np.abs(back[8:] - [0.4, 0.1, 0.1]).max() < 0.005
    mt.save_image(tmp_path / "out.exr", photo.original, photo)
    light = read_exr(tmp_path / "out.exr")
    assert light[0, 0, 0] < -0.2 and np.array_equal(light[:, 8:], photo.original[:, 8:])


def test_a_photo_that_states_its_colours_without_a_profile_gets_one(tmp_path):
    picture = Image.fromarray(LEVELS)
    exif = picture.getexif()
    exif.get_ifd(0x8769)[0xA001] = 2  # Adobe RGB, as cameras write it
    photo = photo_of_levels(tmp_path, kind="jpg", exif=exif, quality=100, subsampling=0)
    stored = np.asarray(Image.open(tmp_path / "photo.jpg"))
    mt.save_image(tmp_path / "out.png", with_edit(photo), photo)
    image = Image.open(tmp_path / "out.png")
    assert outside(np.asarray(image), stored)
    named = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"])).profile
    assert named.profile_description == "Adobe RGB"
    assert image.getexif().get_ifd(0x8769)[0xA001] == 65535


@pytest.mark.parametrize("orientation", [2, 6, 8])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("kind", ["png", "tif", "webp"])
def test_turned_photos_of_wide_colours_keep_their_levels(tmp_path, kind, dtype, orientation):
    if kind == "webp" and dtype != np.uint8:
        pytest.skip("WebP has 8 bits")
    levels = LEVELS.astype(dtype) * dtype(np.iinfo(dtype).max // 255)
    path = tmp_path / f"photo.{kind}"
    if kind == "tif":
        tag = (0x112, "H", 1, orientation, True)
        tifffile.imwrite(path, levels, photometric="rgb", iccprofile=P3, extratags=[tag])
    else:
        exif = Image.Exif()
        exif[0x112] = orientation
        settings = {"exif": exif, "icc_profile": P3, "lossless": True}
        Image.fromarray(LEVELS).save(path, **settings)
        if dtype == np.uint16:
            path.write_bytes(b"".join(_png(levels.copy(), exif.tobytes(), P3)))
    photo = read_photo(path)
    mt.save_image(tmp_path / "out.tif", photo.original, photo)
    written = tifffile.imread(tmp_path / "out.tif")
    upright = turned_upright(levels, {"Orientation": orientation})
    assert written.dtype == dtype and np.array_equal(written, upright)
    assert np.array_equal(read_photo(tmp_path / "out.tif").original, photo.original)


def test_a_jpeg_without_its_end_keeps_its_colours(tmp_path):
    buffer = io.BytesIO()
    Image.fromarray(LEVELS).save(buffer, "JPEG", icc_profile=P3)
    (tmp_path / "a.jpg").write_bytes(buffer.getvalue()[:-2])
    photo = read_photo(tmp_path / "a.jpg")
    assert mt.save_image(tmp_path / "out.png", photo.original, photo) == ()
    assert Image.open(tmp_path / "out.png").info["icc_profile"] == P3


@pytest.mark.parametrize("orientation", [1, 6])
def test_a_wide_tiff_in_planes_keeps_its_levels(tmp_path, orientation):
    levels = LEVELS.astype(np.uint16) * 257
    tag = (0x112, "H", 1, orientation, True)
    settings = {"planarconfig": "separate", "iccprofile": P3, "extratags": [tag]}
    planes = np.moveaxis(levels, -1, 0)
    tifffile.imwrite(tmp_path / "a.tif", planes, photometric="rgb", **settings)
    photo = read_photo(tmp_path / "a.tif")
    mt.save_image(tmp_path / "out.png", photo.original, photo)
    written = cv2.imread(str(tmp_path / "out.png"), cv2.IMREAD_UNCHANGED)[..., ::-1]
    assert np.array_equal(written, turned_upright(levels, {"Orientation": orientation}))


@pytest.mark.parametrize(("profile", "notes"), [(P3, 1), (srgb_profile(), 0), (None, 0)])
def test_colours_of_a_tiff_of_a_rare_layout_are_told_of(tmp_path, profile, notes):
    levels = LEVELS.astype(np.uint32) << 24
    tifffile.imwrite(tmp_path / "a.tif", levels, photometric="rgb", iccprofile=profile)
    photo = read_photo(tmp_path / "a.tif")
    told = mt.save_image(tmp_path / "out.png", photo.original, photo)
    assert sum("rare layout" in note for note in told) == notes


def test_colours_that_are_not_written_are_told_of(tmp_path):
    Image.fromarray(LEVELS).convert("CMYK").save(tmp_path / "a.tif")
    photo = read_photo(tmp_path / "a.tif")
    (note,) = mt.save_image(tmp_path / "out.png", photo.original, photo)
    assert "CMYK" in note and "sRGB" in note
    assert np.array_equal(read_photo(tmp_path / "out.png").original, photo.original)


@pytest.mark.parametrize("kind", ["png", "jpg", "tif", "webp", "avif"])
@pytest.mark.parametrize("source", ["jpg", "png", "tif", "webp"])
def test_exif_goes_along_upright_and_names_the_program(kind, source, tmp_path):
    exif = Image.Exif()
    exif[0x010F], exif[0x0110], exif[0x0131], exif[0x0112] = "Canon", "R5", "Firmware", 6
    exif.get_ifd(0x8769).update({0x9003: "2026:05:04 10:11:12", 0xA405: 28, 0xA002: 41, 0xA003: 30})
    exif.get_ifd(0x8825).update({1: "N", 2: (48.0, 8.0, 0.0)})
    settings = {} if source in ("png", "tif") else {"quality": 100}
    if source == "tif":  # Pillow writes none of the inner directories
        (tmp_path / "photo.tif").write_bytes(tiff_bytes(LEVELS, exif, srgb_profile()))
        photo = read_photo(tmp_path / "photo.tif")
    else:
        photo = photo_of_levels(tmp_path, kind=source, exif=exif, **settings)
    assert photo.original.shape == (41, 30, 3)
    mt.save_image(tmp_path / f"out.{kind}", photo.original, photo)
    image = Image.open(tmp_path / f"out.{kind}")
    found = image.getexif()
    assert image.size == (30, 41)
    assert (found[0x010F], found[0x0110], found[0x0131]) == ("Canon", "R5", SOFTWARE)
    assert found.get(0x0112, 1) == 1
    taken = found.get_ifd(0x8769)
    assert (taken[0x9003], taken[0xA405]) == ("2026:05:04 10:11:12", 28)
    assert (taken[0xA002], taken[0xA003]) == (30, 41)
    assert found.get_ifd(0x8825)[1] == "N" and [float(v) for v in found.get_ifd(0x8825)[2]] == [
        48.0,
        8.0,
        0.0,
    ]
    again = read_photo(tmp_path / f"out.{kind}")
    assert again.original.shape == photo.original.shape and again.camera.fov == pytest.approx(
        photo.camera.fov
    )


def test_a_deep_tiff_has_exif_too_and_other_programs_read_it(tmp_path):
    photo = replace(photo_of_levels(tmp_path), deep=True)
    mt.save_image(tmp_path / "out.tif", photo.original, photo)
    with TiffFile(tmp_path / "out.tif") as file:
        page = file.pages[0]
        assert (
            page.tags["Software"].value == SOFTWARE
            and page.tags["InterColorProfile"].value == srgb_profile()
        )
        assert page.compression.name == "ADOBE_DEFLATE" and page.bitspersample == 16


def test_damaged_exif_does_not_stop_a_picture(tmp_path):
    photo = photo_of_levels(tmp_path, kind="jpg", exif=b"Exif\0\0MM\0*\0\0\xff\xff broken")
    assert mt.save_image(tmp_path / "out.jpg", photo.original, photo) == ()


def test_an_exr_has_what_of_exif_has_a_standard_attribute(tmp_path):
    exif = Image.Exif()
    exif[0x010F] = "Canon"
    exif.get_ifd(0x8769).update({0x9003: "2026:05:04 10:11:12", 0x829A: 0.01, 0x829D: 2.8})
    photo = photo_of_levels(tmp_path, kind="jpg", exif=exif)
    mt.save_image(tmp_path / "out.exr", photo.original, photo)
    header = OpenEXR.File(str(tmp_path / "out.exr")).header()
    assert (header["cameraMake"], header["capDate"]) == ("Canon", "2026:05:04 10:11:12")
    assert header["expTime"] == pytest.approx(0.01) and header["aperture"] == pytest.approx(2.8)
    assert "lensModel" not in header and np.array_equal(
        read_exr(tmp_path / "out.exr"), photo.original
    )


def test_a_makers_note_that_a_jpeg_has_no_room_for(tmp_path, monkeypatch):
    exif = Image.Exif()
    exif[0x010F] = "Canon"
    exif.get_ifd(0x8769).update({0x927C: b"x" * 3000, 0xA405: 28})
    monkeypatch.setattr("materialist.io.out.encode._EXIF_BYTES", 2000)
    photo = photo_of_levels(tmp_path, exif=exif)
    (note,) = mt.save_image(tmp_path / "out.jpg", photo.original, photo)
    assert (
        "maker" in note and Image.open(tmp_path / "out.jpg").getexif().get_ifd(0x8769)[0xA405] == 28
    )


def test_without_a_photo_a_picture_is_srgb(tmp_path):
    picture = np.full((9, 12, 3), 0.5, np.float32)
    picture[0, 0] = np.nan
    mt.save_image(tmp_path / "a.png", picture)
    image = Image.open(tmp_path / "a.png")
    assert image.getpixel((3, 3)) == (188, 188, 188) and image.info["icc_profile"] == srgb_profile()
    assert mt.save_image(tmp_path / "a.tiff", picture, bits=16) == ()
    scene = make_scene()
    mt.save_image(tmp_path / "b.png", scene.photo.original, scene)
    assert np.array_equal(read_photo(tmp_path / "b.png").original, scene.photo.original)


def test_equal_pictures_are_equal_files(tmp_path):
    photo = photo_of_levels(tmp_path, icc_profile=P3)
    for kind in ("png", "jpg", "tif", "webp", "avif"):
        for name in "ab":
            mt.save_image(tmp_path / f"{name}.{kind}", photo.original, photo)
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes(), kind


@pytest.mark.parametrize(
    ("name", "settings", "words"),
    [
        ("a.gif", {}, r"must end in .png, .jpg, .tif, .webp or .avif"),
        ("a", {}, "must end in"),
        ("a.png", {"quality": 80}, "JPEG, WEBP and AVIF take whole numbers"),
        ("a.jpg", {"quality": 0}, "quality is 0"),
        ("a.jpg", {"quality": 101}, "quality is 101"),
        ("a.jpg", {"bits": 16}, "cannot have 16 bits"),
        ("a.png", {"bits": 12}, "cannot have 12 bits"),
        ("a.exr", {"bits": 16}, "cannot have 16 bits"),
    ],
)
def test_options_that_no_file_has(name, settings, words, tmp_path):
    with pytest.raises(InputError, match=words):
        mt.save_image(tmp_path / name, np.zeros((8, 8, 3)), **settings)
    assert not list(tmp_path.iterdir())


def test_arrays_and_files_that_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"The picture is \[8, 8\]"):
        mt.save_image(tmp_path / "a.png", np.zeros((8, 8)))
    with pytest.raises(InputError, match="at most 16383 pixels"):
        mt.save_image(tmp_path / "a.webp", np.zeros((1, 16_384, 3), np.float32))
    (tmp_path / "a.png").write_bytes(b"mine")
    with pytest.raises(OutputError, match="give `force=True`"):
        mt.save_image(tmp_path / "a.png", np.zeros((8, 8, 3)))
    assert (tmp_path / "a.png").read_bytes() == b"mine"


@pytest.mark.parametrize(
    "space",
    [
        spaces.space("sRGB", spaces.REC709, spaces.srgb_curve),
        spaces.space("Adobe RGB", spaces.ADOBE_RGB, spaces.power_curve(563 / 256)),
        spaces.space("Rec. 2020", spaces.REC2020, video_curve),
    ],
    ids=lambda space: space.name,
)
def test_profiles_say_what_the_space_does(space):
    profile = profile_of(space)
    back = matrix_profile(profile)
    assert np.abs(back.matrix - space.matrix).max() < 1e-4
    levels = np.linspace(0, 1, 777)
    assert np.abs(back.curves[0](levels) - space.curves[0](levels)).max() < 3e-5
    # LittleCMS, which other programs use, agrees.
    image = Image.fromarray(np.random.default_rng(4).integers(60, 190, (8, 8, 3)).astype(np.uint8))
    source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
    theirs = ImageCms.profileToProfile(
        image, source, ImageCms.createProfile("sRGB"), renderingIntent=1
    )
    ours = srgb_levels(space.linear(np.asarray(image)))
    assert np.abs(np.asarray(theirs, np.int16) - ours).max() <= 2


@pytest.mark.parametrize("bits", [8, 10])
def test_a_heic_of_more_bits_is_a_deep_photo(bits, tmp_path):
    from pillow_heif import from_bytes

    deep = np.random.default_rng(7).integers(0, 65536, (64, 64, 3)).astype(np.uint16)
    pixels, mode = (deep, "RGB;16") if bits > 8 else ((deep >> 8).astype(np.uint8), "RGB")
    from_bytes(mode, (64, 64), pixels.tobytes()).save(str(tmp_path / "a.heic"), quality=90)
    photo = read_photo(tmp_path / "a.heic")
    mt.save_image(tmp_path / "out.png", photo.original, photo)
    stored = cv2.imread(str(tmp_path / "out.png"), cv2.IMREAD_UNCHANGED)
    assert stored.dtype == (np.uint16 if bits > 8 else np.uint8)
    assert np.abs(read_photo(tmp_path / "out.png").original - photo.original).max() < (
        1e-4 if bits > 8 else 1e-6
    )


@pytest.mark.parametrize(
    ("primaries", "curve", "name"),
    [
        (spaces.DISPLAY_P3, spaces.srgb_curve, "Display P3"),
        (spaces.REC709, spaces.power_curve(1.8), "sRGB primaries"),
        (spaces.REC2020, video_curve, "Rec.2020 primaries"),
        (spaces.ACES_AP1, spaces.srgb_curve, "mine"),
    ],
)
def test_profiles_have_the_names_that_people_know(primaries, curve, name):
    profile = ImageCms.ImageCmsProfile(
        io.BytesIO(profile_of(spaces.space("mine", primaries, curve)))
    ).profile
    assert profile.profile_description == name


def test_wide_colours_of_a_transparent_photo_are_told_of(tmp_path):
    clear = np.dstack([LEVELS, np.full(LEVELS.shape[:2], 128, np.uint8)])
    photo = photo_of_levels(tmp_path, clear, icc_profile=P3)
    (note,) = mt.save_image(tmp_path / "out.png", photo.original, photo)
    assert "clipped" in note and Image.open(tmp_path / "out.png").info["icc_profile"] == P3
    half = 1.45 * 2.28 / 255 / 2  # a level near white, by the matrix from P3 to Rec.709
    assert np.abs(read_photo(tmp_path / "out.png").original - photo.original).max() < half
