"""The scene package: exact round trip, and whole or not at all."""

import errno
import json
import os
import re
import shutil
import subprocess
import sys
from collections import namedtuple
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from made_scene import make_body, make_scene

from materialist import __version__
from materialist.errors import OutputError, SceneError
from materialist.io import atomic
from materialist.io.atomic import ensure_writable, whole_folder
from materialist.io.exr import write_exr
from materialist.io.meshes import read_ply, write_ply
from materialist.io.package import (
    check_room,
    load_scene,
    replace_rerender,
    save_scene,
    with_rerender,
)


@pytest.fixture
def scene():
    """One that was saved before: its provenance has the version of the tool."""
    made = make_scene()
    return replace(made, provenance={"tool_version": __version__, **made.provenance})


def assert_same(a, b, where="scene"):
    """Every field of two dataclass trees, arrays bit for bit with their dtypes."""
    assert type(a) is type(b), where
    if is_dataclass(a):
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{where}.{field.name}")
    elif isinstance(a, np.ndarray):
        assert a.dtype == b.dtype and a.shape == b.shape, where
        assert a.tobytes() == b.tobytes(), where
    elif isinstance(a, dict):
        assert a.keys() == b.keys(), where
        for key in a:
            assert_same(a[key], b[key], f"{where}.{key}")
    elif isinstance(a, tuple) and a and is_dataclass(a[0]):
        assert len(a) == len(b), where
        for k, (one, other) in enumerate(zip(a, b)):
            assert_same(one, other, f"{where}[{k}]")
    else:
        assert a == b, where


@pytest.mark.parametrize("from_memory", [False, True])
def test_round_trip_with_bodies_is_exact(scene, tmp_path, from_memory):
    body = make_body()
    coated = replace(body, name="another", surface=replace(body.surface, glass_roughness=0.25))
    light = np.random.default_rng(1).random((8, 16, 4), np.float32) * 100
    spread = {"albedo": scene.depth * 0 + 0.1, "normal": scene.depth * 0.2}
    prior = replace(scene.prior, light=light, spread=spread)
    full = replace(scene, bodies=(body, coated), prior=prior)
    if from_memory:
        original = scene.photo.original[:7, :5] * 7
        full = replace(full, photo=replace(scene.photo, source=None, path=None, original=original))
    save_scene(full, tmp_path / "a.scene")
    assert_same(load_scene(tmp_path / "a.scene"), full)
    (tmp_path / "a.scene/bodies/1.albedo.exr").unlink()
    with pytest.raises(SceneError, match=r"1\.albedo\.exr"):
        load_scene(tmp_path / "a.scene")
    save_scene(scene, tmp_path / "a.scene", force=True)  # the light is a file of the package, too


def test_a_rerendering_replaces_that_of_a_package_and_nothing_else(scene, tmp_path):
    path = tmp_path / "a.scene"
    report = replace(scene.report, metrics={}, warnings=("early",))
    early = replace(scene, rerender=0.5 * scene.rerender, report=report)
    early = replace(early, provenance={**scene.provenance, "spp": 0})
    save_scene(early, path)
    before = {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}
    replace_rerender(scene, path)
    assert_same(load_scene(path), scene)
    names = {
        file.relative_to(path).as_posix() for file in before if file.read_bytes() != before[file]
    }
    assert names == {
        "rerender.exr",
        "rerender.png",
        "maps/shading_residual.exr",
        "overview.png",
        "report.json",
        "scene.json",
    }
    assert_same(with_rerender(early, path), scene)
    save_scene(early, tmp_path / "b.scene")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.scene", "b.scene"]
    with pytest.raises(SceneError, match="no scene package"):
        replace_rerender(scene, tmp_path / "missing.scene")
    assert not (tmp_path / "missing.scene").exists()


def test_a_rerendering_that_is_interrupted_leaves_the_old_report(scene, tmp_path, monkeypatch):
    path = tmp_path / "a.scene"
    early = replace(scene, report=replace(scene.report, metrics={}))
    save_scene(early, path)
    place = os.replace

    def until_the_report(source, target):
        if str(target).endswith(".json"):
            raise OSError(28, "No space left on device")
        place(source, target)

    monkeypatch.setattr("os.replace", until_the_report)
    with pytest.raises(OutputError, match="no space left"):
        replace_rerender(replace(scene, rerender=0.5 * scene.rerender), path)
    loaded = load_scene(path)
    assert loaded.report.metrics == {}
    np.testing.assert_array_equal(loaded.rerender, 0.5 * scene.rerender)
    assert [file.name for file in tmp_path.iterdir()] == ["a.scene"]


def test_the_files_of_the_contract(scene, tmp_path):
    with pytest.raises(OutputError, match="no folder"):
        save_scene(scene, tmp_path / "deep/down/a.scene")
    assert not (tmp_path / "deep").exists()
    (tmp_path / "deep/down").mkdir(parents=True)
    save_scene(scene, tmp_path / "deep/down/a.scene")
    root = tmp_path / "deep/down/a.scene"
    maps = ("albedo", "roughness", "metallic", "normal", "depth")
    expected = {
        "scene.json",
        "photo.exr",
        "photo.png",
        "original.png",
        "envmap.exr",
        "mesh.ply",
        "plane_label.png",
    }
    expected |= {
        "rerender.exr",
        "rerender.png",
        "report.json",
        "overview.png",
        "maps/shading_residual.exr",
    }
    expected |= {f"{folder}/{name}.exr" for folder in ("prior", "maps") for name in maps}
    assert {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()} == expected
    assert os.listdir(tmp_path / "deep/down") == ["a.scene"]
    report = json.loads((root / "report.json").read_text())
    assert report["rerender_psnr_path"] == 31.25 and report["warnings"] == ["dim"]
    meta = json.loads((root / "scene.json").read_text())
    assert meta["version"] == 1 and meta["size"] == [33, 24] and meta["provenance"]["seed"] == 3
    meta["provenance"]["tool_version"] = "0.0.9"  # the version that made a scene stays with it
    (root / "scene.json").write_text(json.dumps(meta))
    assert load_scene(root).provenance["tool_version"] == "0.0.9"


def test_force_alone_replaces_a_scene_and_never_what_somebody_put_beside_it(scene, tmp_path):
    place = tmp_path / "a.scene"
    save_scene(scene, place)
    other = replace(scene, envmap=scene.envmap * 2)
    with pytest.raises(OutputError, match="force=True"):
        save_scene(other, place)
    assert_same(load_scene(place), scene)
    save_scene(other, place, force=True)
    assert_same(load_scene(place), other)
    assert os.listdir(tmp_path) == ["a.scene"]
    for name in ("mask.png", "maps/mask.png", "original.psd", ".keys/a.txt", "bodies/notes.txt"):
        (place / name).parent.mkdir(exist_ok=True)
        (place / name).write_text("mine")
        with pytest.raises(
            OutputError, match=f"holds {re.escape(name)}, which does not belong to a scene package"
        ):
            save_scene(scene, place, force=True)
        assert (place / name).read_text() == "mine"
        (place / name).unlink()
    (place / ".DS_Store").touch()  # a file manager's
    save_scene(scene, place, force=True)


def test_force_never_replaces_what_is_not_a_scene(scene, tmp_path):
    (tmp_path / "holiday").mkdir()
    (tmp_path / "holiday/precious.jpg").write_text("x")
    (tmp_path / "file").write_text("x")
    (tmp_path / "link").symlink_to(tmp_path / "holiday")
    for name, words in (
        ("holiday", "not a scene package"),
        ("file", "not a scene package"),
        ("link", "is a link"),
    ):
        with pytest.raises(OutputError, match=words):
            save_scene(scene, tmp_path / name, force=True)
    assert (tmp_path / "holiday/precious.jpg").exists()


@pytest.mark.parametrize("place", ["/proc/a.scene", "FILE/a.scene", "n" * 300, "/"])
def test_places_that_cannot_be_written(scene, tmp_path, place):
    (tmp_path / "FILE").write_text("x")
    where = place if place.startswith("/") else tmp_path / place
    for attempt in (lambda: ensure_writable(where), lambda: save_scene(scene, where)):
        with pytest.raises(OutputError) as caught:
            attempt()
        assert "\n" not in str(caught.value)
    assert os.listdir(tmp_path) == ["FILE"]


@pytest.mark.parametrize("limit", [200, 30_000])
def test_files_that_the_system_really_refuses_to_grow(tmp_path, limit):
    """A file size limit stands for a full disk; each size stops another writer."""
    resource = pytest.importorskip("resource", reason="needs POSIX limits")
    scene = make_scene(64, 80)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        with pytest.raises(OutputError, match="cannot be written"):
            save_scene(scene, tmp_path / "a.scene")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert os.listdir(tmp_path) == []


def test_a_failed_rename_puts_the_old_scene_back(scene, tmp_path, monkeypatch):
    save_scene(scene, tmp_path / "a.scene")
    rename = os.rename

    def stubborn(source, destination):
        if "partial" in str(source):
            raise OSError(errno.EIO, "Input/output error")
        rename(source, destination)

    monkeypatch.setattr(atomic.os, "rename", stubborn)
    with pytest.raises(OutputError, match="input/output"):
        save_scene(replace(scene, envmap=scene.envmap * 2), tmp_path / "a.scene", force=True)
    monkeypatch.undo()
    assert_same(load_scene(tmp_path / "a.scene"), scene)
    assert os.listdir(tmp_path) == ["a.scene"]


def test_leftovers_of_a_killed_run_are_swept_by_the_next_save(scene, tmp_path):
    """A child is killed between two files of the package, and once more between the two renames."""
    script = (
        "import os\nfrom made_scene import make_scene\n"
        "from materialist.io import atomic, package\n"
        "def die(*a, **k): os.kill(os.getpid(), 9)\n{patch}\n"
        "package.save_scene(make_scene(), {place!r}, force=True)\n"
    )
    place = tmp_path / "a.scene"
    kill_midway = script.format(place=str(place), patch="package.write_ply = die")
    assert subprocess.run([sys.executable, "-c", kill_midway], check=False).returncode == -9
    assert not place.exists() and len(os.listdir(tmp_path)) == 1
    save_scene(scene, place)
    assert os.listdir(tmp_path) == ["a.scene"]

    patch = "old = os.rename\ndef swap(s, d): old(s, d) or die()\natomic.os.rename = swap"
    kill_between = script.format(place=str(place), patch=patch)
    assert subprocess.run([sys.executable, "-c", kill_between], check=False).returncode == -9
    assert not place.exists()
    with pytest.raises(SceneError, match="mv "):
        load_scene(place)
    save_scene(replace(scene, provenance={}), place, force=True)
    assert load_scene(place).provenance == {"tool_version": __version__} and os.listdir(
        tmp_path
    ) == ["a.scene"]


def test_missing_and_unknown_packages(scene, tmp_path):
    with pytest.raises(SceneError, match="no scene package at"):
        load_scene(tmp_path / "nothing")
    (tmp_path / "empty").mkdir()
    with pytest.raises(SceneError, match="missing"):
        load_scene(tmp_path / "empty")
    root = tmp_path / "a.scene"
    save_scene(scene, root)
    meta = json.loads((root / "scene.json").read_text())
    (root / "scene.json").write_text(json.dumps({**meta, "version": 99}))
    with pytest.raises(SceneError, match="version 99"):
        load_scene(root)
    (root / "scene.json").write_text(json.dumps(meta))
    write_exr(root / "maps/albedo.exr", scene.materials.albedo[:-1])
    with pytest.raises(
        SceneError, match=r"albedo.exr is \[23, 33, 3\], the scene needs \[24, 33, 3\]"
    ):
        load_scene(root)


@pytest.mark.parametrize(
    ("file", "key", "value", "words"),
    [
        ("scene.json", "provenance", [], "provenance"),
        ("scene.json", "prior", {"predictor": 5, "warnings": []}, "predictor"),
        ("scene.json", "prior", {"predictor": "made", "warnings": [None]}, "warnings"),
        ("scene.json", "prior", {"predictor": "made", "warnings": "dim"}, "warnings"),
        ("report.json", "warnings", [{}], "warnings"),
        ("report.json", "rerender_psnr_path", "high", "rerender_psnr_path"),
    ],
)
def test_values_of_another_type_are_refused_by_name(scene, tmp_path, file, key, value, words):
    save_scene(scene, tmp_path / "a.scene")
    path = tmp_path / "a.scene" / file
    path.write_text(json.dumps({**json.loads(path.read_text()), key: value}))
    with pytest.raises(SceneError, match=f"The {words} of the scene cannot be"):
        load_scene(tmp_path / "a.scene")


def test_a_source_of_the_field_of_view_is_a_text(scene, tmp_path):
    save_scene(replace(scene, photo=replace(scene.photo, fov_source=[1])), tmp_path / "a.scene")
    with pytest.raises(SceneError, match="fov_source"):
        load_scene(tmp_path / "a.scene")


def test_names_in_another_encoding(scene, tmp_path):
    """A photo may have one; the EXR library cannot be told a folder with one."""
    odd = replace(scene, photo=replace(scene.photo, path="caf\udce9.png"))
    save_scene(odd, tmp_path / "a.scene")
    assert load_scene(tmp_path / "a.scene").photo.path == "caf\udce9.png"
    with pytest.raises(OutputError, match="not UTF-8"):
        save_scene(scene, tmp_path / "caf\udce9.scene")
    assert [path.name for path in tmp_path.iterdir()] == ["a.scene"]


def test_mesh_file_header_is_what_other_tools_expect(scene, tmp_path):
    write_ply(tmp_path / "m.ply", scene.geometry.mesh)
    assert_same(read_ply(tmp_path / "m.ply"), scene.geometry.mesh)
    head = (tmp_path / "m.ply").read_bytes().split(b"end_header\n")[0].decode().splitlines()
    assert head[:2] == ["ply", "format binary_little_endian 1.0"]
    assert f"element vertex {24 * 33}" in head and "property list uchar int vertex_indices" in head
    (tmp_path / "m.ply").write_bytes((tmp_path / "m.ply").read_bytes()[:-1])
    with pytest.raises(SceneError, match="truncated"):
        read_ply(tmp_path / "m.ply")


def test_a_disk_without_room_is_refused_before_the_work(scene, tmp_path, monkeypatch):
    check_room(tmp_path / "a.scene", scene.photo)
    usage = namedtuple("usage", "total used free")
    # The light and the overview of an inversion take more, however small the photo is.
    for free in (1000, 1_500_000):
        monkeypatch.setattr(
            shutil, "disk_usage", lambda folder, free=free: usage(10**9, 10**9 - free, free)
        )
        with pytest.raises(
            OutputError, match=rf"no space left .* takes about [\d,]+ bytes, and {free:,}"
        ):
            check_room(tmp_path / "a.scene", scene.photo)


def test_what_comes_to_the_target_in_the_meantime_is_not_replaced(tmp_path):
    with pytest.raises(OutputError, match="exists"), whole_folder(tmp_path / "k.scene") as folder:
        (folder / "scene.json").write_text("{}")
        (tmp_path / "k.scene").mkdir()
        (tmp_path / "k.scene" / "precious.txt").write_text("mine")
    assert [p.name for p in tmp_path.iterdir()] == ["k.scene"]
    assert (tmp_path / "k.scene" / "precious.txt").read_text() == "mine"
