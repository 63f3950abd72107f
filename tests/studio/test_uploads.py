"""What strangers send."""

import cv2
import numpy as np
import OpenEXR
import pytest
from made_png import png_header
from studio_scenes import zipped, zipped_package

from materialist.errors import InputError, SceneError
from materialist.io.decode import decoded_bytes, image_size
from materialist.io.exr import write_exr
from materialist.io.package import load_scene
from materialist.studio import StudioSettings, archives, uploads
from materialist.studio.access.quota import Allowance
from materialist.studio.session import Session

pytestmark = pytest.mark.usefixtures("opens_here")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.exe", b"MZ", "not a photo"),
        ("a.svg", b"<svg/>", "not a photo"),
        ("a.png", b"hello", "not an image"),
        ("a.png", b"", "empty"),
        ("a.exr", b"\x76\x2f\x31\x01rest", "no readable EXR"),
        ("a.hdr", b"#?RADIANCE\n\n", "no size"),
        ("noending", b"x", "not a photo"),
        ("a.png", png_header(30_000, 30_000), "megapixels"),
        ("a.png", png_header(30_000, 2_500), "75 megapixels"),
        ("a.png", png_header(30_000, 100), "longer than"),
        ("a.png", png_header(4, 4), "at least"),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 50000\n", "2000 megapixels"),
    ],
)
def test_pictures_are_refused_by_their_header(tmp_path, name, content, message):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(InputError, match=message):
        uploads.checked_picture(file)


def test_sizes_of_other_headers(tmp_path):
    write_exr(tmp_path / "a.exr", np.zeros((12, 40, 3), np.float32))
    assert image_size(tmp_path / "a.exr") == (40, 12)
    # Pillow does not know the pixels of a float TIFF, and `invert` reads it.
    cv2.imwrite(str(tmp_path / "a.tif"), np.full((20, 30, 3), 0.5, np.float32))
    assert image_size(tmp_path / "a.tif") == (30, 20)
    uploads.checked_picture(tmp_path / "a.tif")
    (tmp_path / "b.tif").write_bytes((tmp_path / "a.tif").read_bytes()[:6])
    with pytest.raises(InputError, match="not an image"):
        uploads.checked_picture(tmp_path / "b.tif")


@pytest.mark.parametrize("root", ["", "room.scene/"])
def test_a_zipped_scene_comes_back(tmp_path, root):
    more = {f"{root}../evil.txt": "x", "/abs.txt": "x", f"{root}maps/extra.py": "x"}
    archives.unpack_scene(zipped_package(tmp_path, root, **more), tmp_path / "target", Allowance())
    assert load_scene(tmp_path / "target").camera.width == 64
    assert not list(tmp_path.rglob("evil.txt")) and not list(tmp_path.rglob("extra.py"))


def test_a_scene_that_would_not_fit_into_the_server_is_not_decoded(studio, tmp_path, monkeypatch):
    file = zipped_package(tmp_path)
    before = studio.work.projects()
    monkeypatch.setattr(archives, "SETTINGS", StudioSettings(decoded_bytes=100_000))
    with pytest.raises(SceneError, match="GB of memory") as error:
        studio.unpack(Session("me"), file)
    assert studio.work.projects() == before and str(studio.work.root) not in studio.without_folders(
        str(error.value)
    )


def test_zips_that_are_none(tmp_path, monkeypatch):
    (tmp_path / "a.zip").write_bytes(b"PK\x03\x04 broken")
    with pytest.raises(InputError, match="not a readable zip"):
        archives.unpack_scene(tmp_path / "a.zip", tmp_path / "target", Allowance())
    with pytest.raises(InputError, match="no scene package"):
        archives.unpack_scene(
            zipped(tmp_path / "b.zip", {"readme.txt": "x"}), tmp_path / "target", Allowance()
        )
    large = zipped(tmp_path / "c.zip", {"scene.json": "{}", "mesh.ply": b"\0" * 5_000_000})
    monkeypatch.setattr(archives, "SETTINGS", StudioSettings(unpacked_bytes=1_000_000))
    with pytest.raises(InputError, match="unpacks to"):
        archives.unpack_scene(large, tmp_path / "target", Allowance())
    assert not (tmp_path / "target").exists()


def test_meshes_name_no_other_files(tmp_path):
    obj = tmp_path / "a.obj"
    obj.write_text("mtllib ../../secret.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n")
    with pytest.raises(InputError, match="outside of its folder"):
        uploads.used(tmp_path, obj, uploads.MESH, Allowance(), lambda name: None)
    assert [file.name for file in tmp_path.iterdir()] == ["a.obj"]  # what was refused does not stay
    with pytest.raises(InputError, match="not a mesh"):
        uploads.checked_mesh(obj.with_suffix(".gltf"))
    with pytest.raises(InputError, match="no longer here"):
        uploads.checked_mesh(tmp_path / "b.obj")


def test_a_picture_is_measured_by_what_it_holds_and_not_by_its_name(tmp_path):
    channels = {f"{k}.Y": np.zeros((400, 500), np.float32) for k in range(20)}
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, channels).write(str(tmp_path / "a.exr"))
    (tmp_path / "a.exr").rename(tmp_path / "a.png")
    assert decoded_bytes(tmp_path / "a.png") == 400 * 500 * 20 * 4
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(uploads, "SETTINGS", StudioSettings(opening_memory=10_000_000))
        with pytest.raises(InputError, match="save its colours alone"):
            uploads.checked_picture(tmp_path / "a.png")
