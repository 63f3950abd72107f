"""EXR files of layers: what compositors find in them, and that the parts make the picture."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
from edit_scenes import flat_scene

import materialist as mt
from materialist.camera import unproject
from materialist.errors import InputError
from materialist.io.out.layers import cryptomatte_id, murmur3, write_layers
from materialist.types import Body, Camera, Surface

PLAIN = ("beauty", "albedo", "diffuse", "specular", "residual", "N", "Z", "position")


def parts_of(path):
    """Name -> (header, [H, W, C] float32), as the file has them."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        return {
            part.name(): (dict(part.header), {name: c.pixels for name, c in part.channels.items()})
            for part in file.parts
        }


def colour(channels, prefix, letters="RGB"):
    return np.stack([channels[f"{prefix}{c}"].astype(np.float32) for c in letters], -1)


@pytest.fixture(scope="module")
def scene():
    return flat_scene(native=2, sky=3)


@pytest.fixture(scope="module")
def written(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("layers") / "a.exr"
    assert mt.save_layers(path, scene) == ()
    return path


def test_parts_have_the_names_and_spaces_that_compositors_know(scene, written):
    found = parts_of(written)
    assert tuple(found) == PLAIN
    assert {header["colorInteropID"] for header, _ in found.values()} == {
        "lin_rec709_scene",
        "data",
    }
    assert [name for name, (header, _) in found.items() if header["colorInteropID"] == "data"] == [
        "N",
        "Z",
        "position",
    ]
    assert np.array_equal(colour(found["beauty"][1], ""), scene.photo.original)
    assert list(found["Z"][1]) == ["Z"] and set(found["N"][1]) == {"N.X", "N.Y", "N.Z"}
    assert {c.shape for _, channels in found.values() for c in channels.values()} == {
        scene.photo.original.shape[:2]
    }


def test_light_by_lobe_and_the_residual_make_the_picture(scene, written):
    found = {
        name: colour(channels, f"{name}.")
        for name, (_, channels) in parts_of(written).items()
        if name in PLAIN[1:5]
    }
    total = found["diffuse"] + found["specular"] + found["residual"]
    assert np.abs(total - scene.photo.original).max() < 2e-3
    surface = np.kron(scene.depth, np.ones((2, 2))) > 0
    assert found["diffuse"][surface].min() > 0 and found["specular"][surface].mean() > 0
    # A matt wall under light of about one: most of what is seen is diffuse, in the colour of the wall.
    assert 0.5 < (found["diffuse"][20:] / found["albedo"][20:]).mean() < 1.5
    assert not found["diffuse"][:4].any() and not found["specular"][:4].any()


def test_geometry_is_that_of_the_scene_at_native_size(scene, written):
    found = parts_of(written)
    depth = found["Z"][1]["Z"]
    assert np.array_equal(depth[::2, ::2], scene.depth) and np.array_equal(
        depth[1::2, 1::2], scene.depth
    )
    camera = Camera(2 * scene.camera.width, 2 * scene.camera.height, scene.camera.fov)
    assert np.allclose(
        colour(found["position"][1], "position.", "XYZ"), unproject(depth, camera), atol=1e-5
    )
    assert np.allclose(colour(found["N"][1], "N.", "XYZ")[30, 40], scene.normal[15, 20], atol=1e-3)


def test_the_picture_of_such_a_file_is_read_again(scene, written):
    photo = mt.read_photo(written)
    assert np.allclose(photo.original * 2.0**-photo.stops, scene.photo.original, atol=1e-6)


def test_a_picture_of_working_size_and_the_unit_of_an_hdr_photo(scene, tmp_path):
    hdr = replace(scene, photo=replace(scene.photo, hdr=True, stops=-2))
    assert mt.save_layers(tmp_path / "a.exr", hdr, scene.rerender) == ()
    found = parts_of(tmp_path / "a.exr")
    assert np.array_equal(colour(found["beauty"][1], ""), 4 * scene.rerender)
    assert found["Z"][1]["Z"].shape == scene.depth.shape and np.array_equal(
        found["Z"][1]["Z"], scene.depth
    )


def test_bodies_are_things_of_a_cryptomatte(scene, tmp_path):
    corners = np.float32(
        [[-0.4, -0.4, -1.5], [0.4, -0.4, -1.5], [0.4, 0.4, -1.5], [-0.4, 0.4, -1.5]]
    )
    faces = np.int32([[0, 1, 2], [0, 2, 3]])
    normals = np.tile(np.float32([[0, 0, 1]]), (4, 1))
    red = Surface(np.full((1, 1, 3), (0.9, 0, 0), np.float32), *np.full((2, 1, 1), 0.5, np.float32))
    body = Body(corners, faces, normals, np.zeros((4, 2), np.float32), red, name="sign")
    (note,) = mt.save_layers(tmp_path / "a.exr", replace(scene, bodies=(body,)))
    assert "bodies" in note
    found = parts_of(tmp_path / "a.exr")
    header, channels = found["CryptoObject00"]
    manifest = next(value for key, value in header.items() if key.endswith("/manifest"))
    assert json.loads(manifest) == {
        "sign": f"{np.float32(cryptomatte_id('sign')).view(np.uint32):08x}"
    }
    middle = (36, 48)
    assert channels["CryptoObject00.R"][middle] == np.float32(cryptomatte_id("sign"))
    assert channels["CryptoObject00.G"][middle] == 1 and channels["CryptoObject00.G"][0, 0] == 0
    assert found["Z"][1]["Z"][middle] == pytest.approx(1.5, abs=1e-4)
    assert np.allclose(colour(found["albedo"][1], "albedo.")[middle], (0.9, 0, 0), atol=1e-3)


def test_pixels_of_several_things_have_them_by_coverage(tmp_path):
    picture = np.zeros((2, 2, 3), np.float32)
    shares = {
        "a": np.full((2, 2), 0.2),
        "b": np.full((2, 2), 0.5),
        "c": np.float32([[0.3, 0], [0, 0]]),
    }
    write_layers(tmp_path / "a.exr", {"beauty": picture}, shares)
    found = parts_of(tmp_path / "a.exr")
    first = found["CryptoObject00"][1]
    second = found["CryptoObject01"][1]
    ids = {name: np.float32(cryptomatte_id(name)) for name in shares}
    assert first["CryptoObject00.R"][0, 0] == ids["b"] and first["CryptoObject00.G"][0, 0] == 0.5
    assert (
        first["CryptoObject00.B"][0, 0] == ids["c"] and first["CryptoObject00.B"][1, 1] == ids["a"]
    )
    assert second["CryptoObject01.R"][0, 0] == ids["a"] and second["CryptoObject01.R"][1, 1] == 0


@pytest.mark.parametrize(
    ("text", "number"),
    [("", 0), ("hello", 0x248BFA47), ("The quick brown fox jumps over the lazy dog", 0x2E4FF723)],
)
def test_names_are_hashed_as_published(text, number):
    assert murmur3(text.encode()) == number


def test_what_is_refused(scene, tmp_path):
    with pytest.raises(InputError, match=r"ends in \.exr"):
        mt.save_layers(tmp_path / "a.png", scene)
    with pytest.raises(InputError, match=r"picture is \[4, 4\]"):
        mt.save_layers(tmp_path / "a.exr", scene, np.zeros((4, 4)))
    assert not list(tmp_path.iterdir())
