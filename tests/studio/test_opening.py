"""Hostile uploads end as a sentence, in a process of their own with limits."""

import json
import struct
import zlib

import numpy as np
import psutil
import pytest
from studio_scenes import block, zipped, zipped_package

from materialist.errors import InputError
from materialist.io.image import write_png
from materialist.studio import StudioSettings, archives, uploads
from materialist.studio.access.quota import Allowance
from materialist.studio.workspace import write_mask


@pytest.fixture
def limited(monkeypatch):
    """Little memory and little time."""
    limits = StudioSettings(opening_memory=600_000_000, opening_seconds=20)
    monkeypatch.setattr(uploads, "SETTINGS", limits)


def large_png(path, side):
    """A black picture of 8 bits, side x side, of a few kilobytes."""

    def chunk(kind, data):
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    packer = zlib.compressobj(9)
    row = bytes(1 + 3 * side)
    data = b"".join(packer.compress(row) for _ in range(side)) + packer.flush()
    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    parts = chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + parts)
    return path


def sparse_glb(path, count):
    """A mesh whose few bytes stand for `count` vertices."""
    document = {
        "asset": {"version": "2.0"},
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "accessors": [{"componentType": 5126, "type": "VEC3", "count": count}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
    return path


def many_edits(path):
    path.write_text("- edit: {box: [1, 1, 5, 5], hue: 3}\n" * 1000)
    return path


@pytest.mark.parametrize(
    "option",
    [
        "texture",
        pytest.param("envmap", marks=pytest.mark.slow),
        pytest.param("mask", marks=pytest.mark.slow),
    ],
)
def test_a_small_file_of_a_large_picture(tmp_path, limited, option):
    file = large_png(tmp_path / "a.png", 7000)
    assert file.stat().st_size < 500_000
    before = psutil.Process().memory_info().rss
    with pytest.raises(
        InputError, match=r"a\.png.*(needs more than 0.6 GB|may have up to 8 megapixels)"
    ):
        uploads.used(tmp_path, file, option, Allowance(), lambda name: pytest.fail("it was used"))
    assert psutil.Process().memory_info().rss - before < 50e6
    assert [one.name for one in tmp_path.iterdir()] == ["a.png"]


@pytest.mark.slow
def test_a_small_file_of_a_large_mesh(tmp_path, limited):
    file = sparse_glb(tmp_path / "a.glb", 400_000_000)
    before = psutil.Process().memory_info().rss
    with pytest.raises(InputError, match=r"a\.glb"):
        uploads.used(
            tmp_path, file, uploads.MESH, Allowance(), lambda name: pytest.fail("it was used")
        )
    assert psutil.Process().memory_info().rss - before < 50e6


def test_what_can_be_opened_is_stored(tmp_path):
    workspace = tmp_path / "w"
    workspace.mkdir()
    write_png(tmp_path / "wood.png", np.full((8, 8, 3), 90, np.uint8))
    names = []
    uploads.used(workspace, tmp_path / "wood.png", "texture", Allowance(), names.append)
    assert (workspace / names[0]).read_bytes() == (tmp_path / "wood.png").read_bytes()


def test_a_scene_is_unpacked_and_loaded_elsewhere(tmp_path):
    archives.unpack_scene(zipped_package(tmp_path), tmp_path / "target", Allowance())
    assert (tmp_path / "target" / "scene.json").is_file()
    broken = zipped(tmp_path / "b.zip", {"scene.json": "{}"})
    with pytest.raises(InputError, match="does not describe a scene"):
        archives.unpack_scene(broken, tmp_path / "other", Allowance())
    assert not (tmp_path / "other").exists()


@pytest.mark.slow
def test_a_list_of_thousands_of_edits_is_a_sentence(session, tmp_path):
    with pytest.raises(InputError, match="1000 edits; a photo takes up to 200"):
        session.read_edits(many_edits(tmp_path / "edits.yaml"))
    assert session.edits.steps == ()


@pytest.mark.slow
def test_as_many_edits_as_are_allowed_can_be_applied(session, tmp_path):
    mask = write_mask(session.workspace, block())
    step = f"- edit: {{mask: {mask}, hue: 3}}\n"
    (tmp_path / "edits.yaml").write_text(step * 200)
    session.read_edits(tmp_path / "edits.yaml")
    assert len(session.edits.steps) == 200
    assert session.live.here.edited(session.edits.active) is not session.scene
