"""Scene packages from strangers: whatever is in them, a SceneError, within a gigabyte and five seconds."""

import json
import os
import shutil
import struct
from contextlib import suppress
from dataclasses import replace

import numpy as np
import psutil
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from made_png import png_header
from made_scene import make_body, make_scene

from materialist.errors import SceneError
from materialist.io.exr import read_exr, write_exr
from materialist.io.package import load_scene, save_scene
from materialist.types import Scene

resource = pytest.importorskip("resource", reason="needs POSIX limits")
FEW = settings(
    max_examples=25, deadline=5000, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A package with a body."""
    path = tmp_path_factory.mktemp("whole") / "a.scene"
    save_scene(replace(make_scene(), bodies=(make_body(),)), path)
    load_scene(path)
    return path


@pytest.fixture
def copied(whole, tmp_path):
    """A function that gives a fresh copy; within the test there is one more gigabyte of memory."""
    used = psutil.Process().memory_info().vms
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (used + 10**9, hard))

    def copy():
        shutil.rmtree(tmp_path / "a.scene", ignore_errors=True)
        return shutil.copytree(whole, tmp_path / "a.scene")

    yield copy
    resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def window(file, *corners):
    """Let the header of an EXR promise another size; its pixels stay."""
    data = bytearray(file.read_bytes())
    place = data.index(b"dataWindow\0box2i\0") + 21
    data[place : place + 16] = struct.pack("<4i", *corners)
    file.write_bytes(data)


def counted(file, vertices, faces):
    """Let the header of a PLY promise other counts."""
    lines = file.read_bytes().split(b"\n")
    named = [
        f"element vertex {vertices}".encode() if line.startswith(b"element vertex") else line
        for line in lines
    ]
    named = [
        f"element face {faces}".encode() if line.startswith(b"element face") else line
        for line in named
    ]
    file.write_bytes(b"\n".join(named))


def ply_end(file, content):
    """Let the last face end with other bytes."""
    data = file.read_bytes()
    file.write_bytes(data[: -len(content)] + content)


def nan(file):
    pixels = read_exr(file)
    pixels.flat[3] = np.nan
    write_exr(file, pixels)


def grown(root):
    """12000 x 12000, and everything says so."""
    meta = json.loads((root / "scene.json").read_text())
    meta["camera"] |= {"width": 12_000, "height": 12_000}
    (root / "scene.json").write_text(json.dumps(meta))
    for file in (*root.glob("*/[armnd]*.exr"), root / "photo.exr", root / "rerender.exr"):
        window(file, 0, 0, 11_999, 11_999)
    (root / "plane_label.png").write_bytes(png_header(12_000, 12_000))


def said(root, old, new):
    text = (root / "scene.json").read_text()
    assert old in text
    (root / "scene.json").write_text(text.replace(old, new))


def linked(root, name):
    outside = root.parent / "outside"
    shutil.move(root / name, outside)
    (root / name).symlink_to(outside)


FILES = ("scene.json", "report.json", "maps/depth.exr", "mesh.ply", "plane_label.png")
CASES = {
    "a huge map": lambda root: window(root / "maps/albedo.exr", 0, 0, 11_999, 11_999),
    "a huge envmap": lambda root: window(root / "envmap.exr", 0, 0, 2**30, 2**30),
    "a huge texture": lambda root: window(root / "bodies/0.albedo.exr", 0, 0, 30_000, 30_000),
    "a huge photo": lambda root: (root / "original.png").write_bytes(png_header(60_000, 60_000)),
    "a huge label": lambda root: (root / "plane_label.png").write_bytes(png_header(30_000, 30_000)),
    "negative": lambda root: window(root / "prior/depth.exr", 5, 5, -5, -5),
    "all huge": grown,
    "NaN": lambda root: nan(root / "maps/depth.exr"),
    "NaN light": lambda root: nan(root / "envmap.exr"),
    "NaN of a body": lambda root: nan(root / "bodies/0.roughness.exr"),
    "NaN in JSON": lambda root: said(root, '"ior": 1.5', '"ior": NaN'),
    "infinite in JSON": lambda root: said(root, '"ior": 1.5', '"ior": 1e999'),
    "many faces": lambda root: counted(root / "mesh.ply", 9, 9_999_999_999),
    "many vertices": lambda root: counted(root / "bodies/0.ply", 4_000_000_000, 2),
    "a face of no pixel": lambda root: ply_end(
        root / "mesh.ply", struct.pack("<ih", 2**31 - 1, -1)
    ),
    "a face of a pixel below 0": lambda root: ply_end(
        root / "mesh.ply", struct.pack("<ih", -1, -1)
    ),
    "a light without its scale": lambda root: shutil.copy(
        root / "envmap.exr", root / "prior/light.exr"
    ),
    "a huge light": lambda root: window(
        shutil.copy(root / "envmap.exr", root / "prior/light.exr"), 0, 0, 2**30, 2**30
    ),
    "text for a count": lambda root: counted(root / "mesh.ply", "many", 2),
    "deep JSON": lambda root: (root / "scene.json").write_text('{"a":' * 100_000),
    **{f"no {name}": lambda root, name=name: (root / name).unlink() for name in FILES},
    **{f"cut {name}": lambda root, name=name: (root / name).write_bytes(b"{") for name in FILES},
    "many bodies": lambda root: said(root, '"bodies": [', '"bodies": [' + "{}," * 100_000),
    "a list for a photo": lambda root: said(root, '"photo": {', '"photo": [], "x": {'),
    "another original": lambda root: said(root, '"original": "original.png"', '"original": ".."'),
    "a link": lambda root: linked(root, "maps/albedo.exr"),
    "a linked mesh": lambda root: linked(root, "mesh.ply"),
    "a linked photo": lambda root: linked(root, "original.png"),
    "a pipe": lambda root: ((root / "envmap.exr").unlink(), os.mkfifo(root / "envmap.exr")),
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_refused(copied, case):
    root = copied()
    CASES[case](root)
    with pytest.raises(SceneError) as error:
        load_scene(root)
    assert "\n" not in str(error.value)


def test_a_limit_of_memory(copied):
    with pytest.raises(SceneError, match="GB of memory"):
        load_scene(copied(), most=50_000)
    assert load_scene(copied(), most=500_000)


def read(root):
    with suppress(SceneError):
        assert isinstance(load_scene(root), Scene)


@FEW
@given(st.data())
def test_bytes_that_were_changed(copied, data):
    root = copied()
    names = sorted(str(file.relative_to(root)) for file in root.rglob("*") if file.is_file())
    file = root / data.draw(st.sampled_from(names))
    content = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, min(len(content) - 1, 2000)))
        new = data.draw(st.binary(min_size=1, max_size=8))
        content[place : place + len(new)] = new
    file.write_bytes(
        content[: data.draw(st.integers(0, len(content)))] if data.draw(st.booleans()) else content
    )
    read(root)


@FEW
@given(st.data())
def test_sizes_that_were_changed(copied, data):
    root = copied()
    file = data.draw(st.sampled_from(sorted(root.rglob("*.exr"))))
    number = st.integers(-(2**31), 2**31 - 1) | st.integers(-5, 40)
    window(file, *(data.draw(number) for _ in range(4)))
    read(root)


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
    ),
    max_leaves=5,
)


@FEW
@given(st.data())
def test_json_that_was_changed(copied, data):
    root = copied()
    file = root / data.draw(st.sampled_from(["scene.json", "report.json"]))
    meta = inner = json.loads(file.read_text())
    while True:
        keys = sorted(inner) if isinstance(inner, dict) else [*range(len(inner))]
        key = data.draw(st.sampled_from(keys))
        if isinstance(inner[key], dict | list) and inner[key] and data.draw(st.booleans()):
            inner = inner[key]
            continue
        inner[key] = data.draw(JSON)
        break
    file.write_text(json.dumps(meta))
    read(root)
