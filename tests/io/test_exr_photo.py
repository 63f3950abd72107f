"""The photo in an EXR: its layer, colours, windows and pixels; and Radiance pictures beside it."""

import struct
from dataclasses import replace

import cv2
import numpy as np
import OpenEXR
import pytest
from made_colours import (
    TO_2020,
    TO_ACESCG,
    TO_XYZ_E,
    assert_right,
    quadrants,
)
from made_scene import make_scene

from materialist.edits.light.relight import read_envmap, relight
from materialist.errors import InputError
from materialist.io import exr
from materialist.io.colour_space import ACES_AP0, ACES_AP1, CIE_XYZ, REC2020, to_rec709
from materialist.io.exr import picture_rank, read_exr, write_exr
from materialist.io.exr_photo import read_exr_photo
from materialist.io.package import load_scene, save_scene
from materialist.io.photo import read_photo
from materialist.options import InvertOptions

PLAIN = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}


def channels(picture, prefix="", names="RGB"):
    return {
        f"{prefix}{name}": np.ascontiguousarray(picture[..., k], np.float32)
        for k, name in enumerate(names)
    }


def write(path, pixels, **header):
    with OpenEXR.File({**PLAIN, **header}, pixels) as file:
        file.write(str(path))
    return path


def windows(data, display):
    """Header of two windows, each (left, top, width, height)."""
    corners = [
        (np.array([left, top], np.int32), np.array([left + wide - 1, top + high - 1], np.int32))
        for left, top, wide, high in (data, display)
    ]
    return {"dataWindow": corners[0], "displayWindow": corners[1]}


# Colours


@pytest.mark.parametrize(
    ("matrix", "primaries"),
    [(TO_ACESCG, ACES_AP1), (TO_2020, REC2020), (TO_XYZ_E, CIE_XYZ), (np.eye(3), None)],
    ids=["acescg", "rec2020", "xyz", "none"],
)
def test_chromaticities(tmp_path, matrix, primaries):
    header = {} if primaries is None else {"chromaticities": tuple(primaries)}
    photo = read_photo(write(tmp_path / "a.exr", channels(quadrants(matrix)), **header))
    assert_right(photo, 0.003)
    assert all("stops" in warning for warning in photo.warnings)


def test_chromaticities_of_an_environment_map(tmp_path):
    sky = np.zeros((32, 64, 3))
    sky[:16], sky[16:] = (0.3, 0.5, 0.9), (0.3, 0.2, 0.1)
    pixels = channels(sky @ TO_ACESCG.T)
    envmap = read_envmap(write(tmp_path / "sky.exr", pixels, chromaticities=tuple(ACES_AP1)))
    np.testing.assert_allclose(envmap, sky, atol=1e-3)


def test_what_was_assumed_of_an_environment_map_is_a_warning_of_the_scene(tmp_path):
    sky = np.full((32, 64, 3), 0.5)
    file = parts(tmp_path / "sky.exr", normal=sky, rgba=sky)
    warnings = relight(make_scene(24, 33), envmap=file).report.warnings
    assert any("sky.exr" in note and "rgba is taken" in note for note in warnings)


def test_stated_colours_that_cannot_be_used_are_told_of(tmp_path):
    pixels = channels(quadrants())
    broken = read_photo(write(tmp_path / "a.exr", pixels, chromaticities=(0.3,) * 8))
    assert_right(broken, 1e-4)
    assert any("cannot be used" in note for note in broken.warnings)
    odd = read_photo(write(tmp_path / "b.exr", pixels, colorInteropID="g22_rec709_display"))
    assert any("g22_rec709_display" in note for note in odd.warnings)


def test_an_aces_container_without_chromaticities(tmp_path):
    path = write(tmp_path / "a.exr", channels(quadrants()), acesImageContainerFlag=1)
    decoded = read_exr_photo(path)
    expected = quadrants() @ to_rec709(ACES_AP0).T
    np.testing.assert_allclose(decoded.linear, expected, atol=1e-4)
    assert any("ACES2065-1" in note for note in decoded.warnings)


def test_the_name_of_a_colour_space(tmp_path):
    photo = read_photo(
        write(tmp_path / "a.exr", channels(quadrants(TO_ACESCG)), colorInteropID="lin_ap1_scene")
    )
    assert_right(photo, 0.003)


def attribute(name, kind, value):
    return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value


def write_sparse(path, channels):
    """An uncompressed EXR of half channels by hand: name -> ([H, W] values, every how many pixels one is kept)."""
    height, width = next(iter(channels.values()))[0].shape
    names = sorted(channels)
    steps = {name: channels[name][1] for name in names}
    listed = b"".join(
        name.encode() + b"\0" + struct.pack("<iiii", 1, 0, steps[name], steps[name])
        for name in names
    )
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    header = b"\x76\x2f\x31\x01" + struct.pack("<i", 2)
    header += attribute("channels", "chlist", listed + b"\0") + attribute(
        "compression", "compression", b"\0"
    )
    header += attribute("dataWindow", "box2i", box) + attribute("displayWindow", "box2i", box)
    header += attribute("lineOrder", "lineOrder", b"\0") + attribute(
        "pixelAspectRatio", "float", struct.pack("<f", 1)
    )
    header += attribute("screenWindowCenter", "v2f", bytes(8))
    header += attribute("screenWindowWidth", "float", struct.pack("<f", 1)) + b"\0"
    lines = []
    for y in range(height):
        kept = [name for name in names if y % steps[name] == 0]
        line = b"".join(
            channels[name][0][y, :: steps[name]].astype("<f2").tobytes() for name in kept
        )
        lines.append(struct.pack("<ii", y, len(line)) + line)
    starts = len(header) + 8 * height + np.cumsum([0, *map(len, lines[:-1])])
    path.write_bytes(header + starts.astype("<u8").tobytes() + b"".join(lines))
    return path


@pytest.mark.parametrize("step", [1, 2])
def test_luminance_and_chroma(tmp_path, step):
    picture = quadrants()
    y = picture @ np.array([0.2126, 0.7152, 0.0722])
    chroma = {"RY": ((picture[..., 0] - y) / y, step), "BY": ((picture[..., 2] - y) / y, step)}
    assert_right(read_photo(write_sparse(tmp_path / "a.exr", {"Y": (y, 1), **chroma})), 0.005)


# Layers


def parts(path, **pictures):
    made = [OpenEXR.Part({**PLAIN}, channels(picture), name) for name, picture in pictures.items()]
    with OpenEXR.File(made) as file:
        file.write(str(path))
    return path


@pytest.mark.parametrize(
    ("picture", "others"),
    [
        ("rgba", ["normal"]),
        ("C", ["N"]),
        ("ViewLayer.Combined", ["ViewLayer.DiffCol", "ViewLayer.Normal"]),
        ("beauty_denoised", ["albedo"]),
        ("Beauty", ["AO", "unknown"]),
        ("mine", ["Depth", "diffuse_color"]),
    ],
)
@pytest.mark.parametrize("as_parts", [True, False])
def test_the_layer_that_is_the_picture(tmp_path, picture, others, as_parts):
    pictures = {name: 1 - quadrants() for name in others} | {picture: quadrants()}
    if as_parts:
        file = parts(tmp_path / "a.exr", **pictures)
    else:
        layers = [channels(values, f"{name}.") for name, values in pictures.items()]
        file = write(
            tmp_path / "a.exr", {name: values for layer in layers for name, values in layer.items()}
        )
    photo = read_photo(file)
    assert_right(photo, 1e-3)
    assert photo.layer == picture
    assert any(f"{picture} is taken" in note and others[0] in note for note in photo.warnings)


def test_names_of_layers_are_ranked():
    ranked = sorted(
        ["Cryptomatte00", "diffuse", "foo", "beauty", "rgba", "Noisy Image", "N"], key=picture_rank
    )
    assert ranked[:4] == ["rgba", "beauty", "Noisy Image", "foo"]
    assert picture_rank("normal") > picture_rank("anything")


def test_a_layer_by_its_name(tmp_path):
    file = parts(
        tmp_path / "a.exr", rgba=1 - quadrants(), beauty=quadrants(), normal=quadrants() * 0.5
    )
    assert read_exr_photo(file).layer == "rgba"
    photo = read_photo(file, layer="BEAUTY")
    assert photo.layer == "beauty"
    assert_right(photo, 1e-3)
    with pytest.raises(InputError, match="no layer 'depth'; choose one of rgba, beauty, normal"):
        read_photo(file, layer="depth")
    assert InvertOptions(layer="beauty").layer == "beauty"
    cv2.imwrite(str(tmp_path / "a.png"), np.full((20, 20, 3), 9, np.uint8))
    with pytest.raises(InputError, match="no EXR"):
        read_photo(tmp_path / "a.png", layer="beauty")


def test_a_scene_keeps_its_layer(tmp_path):
    file = parts(
        tmp_path / "a.exr", rgba=1 - quadrants(shape=(24, 33)), beauty=quadrants(shape=(24, 33))
    )
    photo = read_photo(file, layer="beauty")
    scene = replace(make_scene(24, 33), photo=photo, camera=photo.camera)
    save_scene(scene, tmp_path / "a.scene")
    np.testing.assert_array_equal(load_scene(tmp_path / "a.scene").photo.original, photo.original)
    assert load_scene(tmp_path / "a.scene").photo.layer == "beauty"


def test_layer_on_the_command_line(refused, tmp_path):
    file = parts(tmp_path / "a.exr", rgba=quadrants(), beauty=quadrants())
    assert "choose one of rgba, beauty" in refused(
        "invert", file, "-o", tmp_path / "a.scene", "--layer", "nothing"
    )


# Windows and pixels


def test_the_display_window_is_the_photo(tmp_path):
    whole = np.pad(quadrants(), ((20, 20), (30, 30), (0, 0)), constant_values=9.0)
    overscan = windows((-30, -20, 156, 104), (0, 0, 96, 64))
    photo = read_photo(write(tmp_path / "over.exr", channels(whole), **overscan))
    assert photo.original.shape == (64, 96, 3)
    np.testing.assert_allclose(photo.original * 2.0**-photo.stops, quadrants(), atol=1e-6)
    inner = quadrants()[8:56, 8:80]
    cut = read_photo(
        write(tmp_path / "cut.exr", channels(inner), **windows((8, 8, 72, 48), (0, 0, 96, 64)))
    )
    assert (
        cut.original.shape == (64, 96, 3)
        and not cut.original[:8].any()
        and not cut.original[:, 80:].any()
    )
    assert_right(cut, 1e-4)
    assert any("does not fill" in note for note in cut.warnings)


def test_windows_of_maps_and_of_alpha(tmp_path):
    depth = {"Y": np.full((48, 72), 3, np.float32)}
    header = windows((8, 8, 72, 48), (0, 0, 96, 64))
    found = read_exr(write(tmp_path / "depth.exr", depth, **header))
    assert found.shape == (64, 96) and found[8:56, 8:80].min() == 3 and found.sum() == 3 * 48 * 72
    pixels = {**channels(quadrants()[8:56, 8:80]), "A": np.ones((48, 72), np.float32)}
    photo = read_photo(write(tmp_path / "alpha.exr", pixels, **header))
    np.testing.assert_array_equal(photo.original[:8], 1)  # what is not there is transparent


def test_windows_that_do_not_meet_or_are_huge_are_refused(tmp_path):
    pixels = channels(quadrants())
    apart = write(tmp_path / "apart.exr", pixels, **windows((200, 0, 96, 64), (0, 0, 96, 64)))
    with pytest.raises(InputError, match="no data in its display window"):
        read_photo(apart)
    huge = write(tmp_path / "huge.exr", pixels, **windows((0, 0, 96, 64), (0, 0, 30000, 20000)))
    with pytest.raises(InputError, match="600 megapixels"):
        read_photo(huge)


def test_all_channels_of_a_file_are_bounded(tmp_path, monkeypatch):
    file = parts(tmp_path / "a.exr", rgba=quadrants(), normal=quadrants())
    monkeypatch.setattr(exr, "LARGEST_BYTES", 12 * 96 * 64)
    for read in (read_photo, read_exr):
        with pytest.raises(InputError, match="in all its channels"):
            read(file)


@pytest.mark.parametrize(("shape", "step"), [(2.0, (1, 2)), (0.5, (2, 1))])
def test_pixels_that_are_not_square(tmp_path, shape, step):
    squeezed = quadrants()[:: step[0], :: step[1]]
    photo = read_photo(write(tmp_path / "a.exr", channels(squeezed), pixelAspectRatio=shape))
    assert photo.original.shape == (64, 96, 3)
    assert_right(photo, 1e-3)
    assert any("square" in note for note in photo.warnings)


def test_a_pixel_shape_that_is_not_believed(tmp_path):
    photo = read_photo(write(tmp_path / "a.exr", channels(quadrants()), pixelAspectRatio=1e6))
    assert photo.original.shape == (64, 96, 3) and any(
        "taken as square" in note for note in photo.warnings
    )


# Radiance


def radiance(path, picture, lines="", resolution="-Y {height} +X {width}", kind="rgbe"):
    """A flat Radiance file: scan lines as they are given."""
    peak = picture.max(-1, keepdims=True)
    exponent = np.ceil(np.log2(np.maximum(peak, 1e-9)))
    mantissa = np.clip(picture / 2.0**exponent * 256, 0, 255)
    packed = np.concatenate([mantissa, exponent + 128], -1).astype(np.uint8)
    height, width = picture.shape[:2]
    size = resolution.format(height=height, width=width)
    path.write_bytes(
        f"#?RADIANCE\n{lines}FORMAT=32-bit_rle_{kind}\n\n{size}\n".encode() + packed.tobytes()
    )
    return path


@pytest.mark.parametrize(
    ("matrix", "lines", "factor", "kind"),
    [
        (TO_2020, "PRIMARIES=0.708 0.292 0.170 0.797 0.131 0.046 0.3127 0.3290\n", 1, "rgbe"),
        (np.eye(3), "COLORCORR=2 1 .5\n", (2, 1, 0.5), "rgbe"),
        (
            np.eye(3),
            "COLORCORR=2 1 .5\nCOLORCORR=2 2 2\nEXPOSURE=3\nEXPOSURE= 0.5\n",
            (6, 3, 1.5),
            "rgbe",
        ),
        (TO_XYZ_E, "", 1, "xyze"),
    ],
    ids=["primaries", "colorcorr", "factors", "xyze"],
)
def test_the_header_of_a_radiance_picture(tmp_path, matrix, lines, factor, kind):
    assert_right(
        read_photo(radiance(tmp_path / "a.hdr", quadrants(matrix) * factor, lines, kind=kind)), 0.01
    )


@pytest.mark.parametrize(
    "line", ["EXPOSURE=0", "EXPOSURE=inf", "COLORCORR=1 2", "PRIMARIES=" + "0.3 " * 8, "EXPOSURE=x"]
)
def test_lines_that_make_no_sense_are_told_of(tmp_path, line):
    photo = read_photo(radiance(tmp_path / "a.hdr", quadrants(), f"{line}\n"))
    assert_right(photo, 0.01)
    assert any("cannot be used" in note for note in photo.warnings)


@pytest.mark.parametrize(("gamma", "notes"), [("2.2", 1), ("1.0", 0)])
def test_a_gamma_that_is_not_used_is_told_of(tmp_path, gamma, notes):
    photo = read_photo(radiance(tmp_path / "a.hdr", quadrants(), f"GAMMA={gamma}\n"))
    assert_right(photo, 0.01)
    assert sum("GAMMA" in note for note in photo.warnings) == notes


@pytest.mark.parametrize(
    ("resolution", "stored"),
    [
        ("-Y {height} +X {width}", lambda picture: picture),
        ("+Y {height} +X {width}", lambda picture: picture[::-1]),
        ("-Y {height} -X {width}", lambda picture: picture[:, ::-1]),
        ("+X {height} -Y {width}", lambda picture: picture.swapaxes(0, 1)),
        ("-X {height} +Y {width}", lambda picture: picture[::-1, ::-1].swapaxes(0, 1)),
    ],
)
def test_every_orientation_of_a_radiance_picture(tmp_path, resolution, stored):
    photo = read_photo(radiance(tmp_path / "a.hdr", stored(quadrants()), resolution=resolution))
    assert photo.original.shape == (64, 96, 3)
    assert_right(photo, 0.01)


def test_pixels_of_a_radiance_picture_that_are_not_square(tmp_path):
    """PIXASPECT is height over width."""
    photo = read_photo(radiance(tmp_path / "a.hdr", quadrants()[:, ::2], "PIXASPECT=0.5\n"))
    assert photo.original.shape == (64, 96, 3)
    assert_right(photo, 0.01)


def test_a_folder_for_temporaries_that_is_read_only_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("OPENCV_TEMP_PATH", str(tmp_path))
    monkeypatch.setattr("os.access", lambda path, mode: str(path) != str(tmp_path))
    with pytest.raises(InputError, match=f"{tmp_path} is read-only; set OPENCV_TEMP_PATH"):
        read_photo(radiance(tmp_path / "a.hdr", quadrants()))


def test_plain_files_stay_bit_for_bit(tmp_path):
    write_exr(tmp_path / "a.exr", quadrants().astype(np.float32))
    decoded = read_exr_photo(tmp_path / "a.exr")
    np.testing.assert_array_equal(decoded.linear, quadrants().astype(np.float32))
    assert decoded.layer is None and decoded.warnings == []


def test_channels_of_cie_xyz_are_colours(tmp_path):
    linear = np.random.default_rng(0).uniform(0.1, 0.9, (12, 16, 3)).astype(np.float32)
    matrix = np.array(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    xyz = (linear @ matrix.T).astype(np.float32)
    # Equal energy is white in CIE XYZ, D65 in Rec.709: adapted, as for all primaries.
    xyz /= (matrix.sum(1)).astype(np.float32)
    channels = {name: np.ascontiguousarray(xyz[..., k]) for k, name in enumerate("XYZ")}
    OpenEXR.File({}, channels).write(str(tmp_path / "a.exr"))
    found = read_exr_photo(tmp_path / "a.exr")
    assert "The channels X, Y and Z are taken as CIE XYZ." in found.warnings
    assert np.abs(found.linear.mean((0, 1)) - linear.mean((0, 1))).max() < 0.05
