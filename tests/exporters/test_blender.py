"""What Blender is given, and how it is called. Blender itself: docs/export.md says how to check against it."""

import ast
import json
import os
import shutil
import stat
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from export_scenes import CHECKS, renderer, room

import materialist as mt
from materialist.edits.core.renderer import rendered
from materialist.edits.core.surfaces import uniform_surface
from materialist.exporters import run
from materialist.exporters.blender import run_script
from materialist.io.exr import read_exr
from materialist.metrics import psnr
from materialist.types import Body

BPY = os.environ.get("MATERIALIST_TEST_BPY", "")
"""A Python that has bpy, to build and render with."""


def fake(tmp_path, body):
    """A program that stands in for Blender."""
    program = tmp_path / "python-with-bpy"
    program.write_text(f"#!{sys.executable}\nimport sys\n{body}\n")
    program.chmod(program.stat().st_mode | stat.S_IEXEC)
    return str(program)


def test_the_folder_holds_what_the_script_reads(tmp_path):
    done = mt.export(room(), tmp_path / "out", to="blend", residual=False)
    folder = done.path
    script = (folder / "build.py").read_text()
    ast.parse(script)
    facts = json.loads((folder / "scene.json").read_text())
    assert (facts["width"], facts["height"], facts["fov"]) == (64, 40, 50.0)
    assert list(facts["parts"]) == ["surface", "plane0", "plane1"] and facts["parts"][
        "surface"
    ] == {
        "maps": "",
        "repeat": False,
    }
    with np.load(folder / "meshes.npz") as arrays:
        assert arrays["surface_uv"].shape[1] == 2 and arrays["plane1_faces"].shape[1] == 3
    np.testing.assert_array_equal(read_exr(folder / "albedo.exr"), room().materials.albedo)
    np.testing.assert_array_equal(read_exr(folder / "envmap.exr"), room().envmap)
    assert set(facts["advice"]) == {"light", "scale", "colour"}
    assert str(folder / "build.py") in done.notes[0] and done.notes[0].startswith(
        "Make the .blend with: blender "
    )


def test_without_blender_the_script_stays(tmp_path, monkeypatch):
    from materialist.exporters import blender

    monkeypatch.setattr(blender, "find_blender", lambda _: None)
    done = mt.export(room(), tmp_path / "room.blend", shadow_catcher=True)
    assert done.path == tmp_path / "room" and not (tmp_path / "room.blend").exists()
    assert (done.path / "build.py").is_file()
    assert done.notes[0].endswith(f"-o {tmp_path / 'room.blend'} --shadow-catcher")


def test_a_blender_that_works(tmp_path):
    program = fake(
        tmp_path, "open(sys.argv[sys.argv.index('-o') + 1], 'w').write(' '.join(sys.argv))"
    )
    done = mt.export(room(), tmp_path / "room.blend", blender=program, fitted_material=True)
    assert done.path.read_text().endswith("--fitted-material")
    assert not any("with: " in note for note in done.notes)  # nothing is left to do
    assert sorted(path.name for path in tmp_path.iterdir()) == ["python-with-bpy", "room.blend"]


def test_a_blender_that_fails(tmp_path, monkeypatch):
    program = fake(tmp_path, "sys.exit('No module named bpy')")
    with pytest.raises(mt.SetupError, match="No module named bpy"):
        mt.export(room(), tmp_path / "room.blend", blender=program)
    monkeypatch.setattr(run, "with_residual", lambda scene: pytest.fail("the work comes first"))
    with pytest.raises(mt.SetupError, match="There is no program /nowhere/blender"):
        mt.export(room(), tmp_path / "room.blend", blender="/nowhere/blender")
    assert [path.name for path in tmp_path.iterdir()] == ["python-with-bpy"]


def by_cycles(scene, tmp_path, *options):
    """[H, W, 3] the scene as Blender renders it."""
    if not shutil.which(BPY):
        pytest.skip("needs MATERIALIST_TEST_BPY, the path of a Python that has bpy")
    folder = mt.export(scene, tmp_path / "out", to="blend").path
    asked = ["--fitted-material", "--render", f"{tmp_path}/r.exr", *options]
    run_script([BPY], folder / "build.py", tmp_path / "r.blend", asked)
    return read_exr(tmp_path / "r.exr")[..., :3]


@pytest.mark.slow
def test_cycles_sees_what_we_see(tmp_path):
    ours = renderer(room()).render(spp=256)
    theirs = by_cycles(room(), tmp_path)
    assert psnr(ours, theirs) > 32
    assert max(psnr(ours, theirs[:, ::-1]), psnr(ours, theirs[::-1])) < 22
    assert max(psnr(ours, np.roll(theirs, 1, axis)) for axis in (0, 1)) < 30


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["texture", "glass", "rough glass", "coat"])
def test_cycles_has_our_bodies(tmp_path, kind):
    surface = {
        "texture": CHECKS,
        "glass": uniform_surface(1.0, 0.0, 0.0, transmission=1.0, ior=1.4, tint=(0.9, 0.5, 0.4)),
        "rough glass": uniform_surface(1.0, 0.4, 0.0, transmission=1.0, ior=1.3),
        "coat": uniform_surface(0.3, 0.3, 0.0, transmission=0.6, ior=1.3),
    }[kind]
    ball = trimesh.creation.icosphere(4, 0.5)
    ways = np.asarray(ball.vertices / 0.5, np.float32)
    uv = np.stack([ways[:, 0] * 0.7 + 1.3, 0.4 - ways[:, 1] * 0.7], 1).astype(np.float32)
    vertices = (ways * 0.5 + [0.1, 0, -2.2]).astype(np.float32)
    body = Body(vertices, np.asarray(ball.faces, np.int32), ways, uv, surface, "ball")
    scene = replace(room(), bodies=(body,))
    ours = rendered(scene, spp=512, seed=0)
    theirs = by_cycles(scene, tmp_path, "--samples", "512")
    y, x = np.indices(ours.shape[:2])
    inside = (x - 34.9) ** 2 + (y - 19.5) ** 2 < 14**2
    np.testing.assert_allclose(theirs[inside].mean(0), ours[inside].mean(0), rtol=0.04)
    blurred = [
        np.stack([x[k : 40 - 5 + k : 5] for k in range(5)]).mean(0) for x in (ours, theirs)
    ]  # rows, five each
    assert np.corrcoef(blurred[0].ravel(), blurred[1].ravel())[0, 1] > 0.97
