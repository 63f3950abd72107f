"""insert and drop on a small scene: files, exit codes, and nothing written on bad input."""

import json

import numpy as np
import pytest
from made_meshes import box_file, floor_scene, textured_obj
from PIL import Image

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.io.exr import read_exr
from materialist.io.package import load_scene, save_scene


@pytest.fixture
def run(capsys):
    """Run a command line; returns (exit code, stdout, stderr)."""

    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A scene and meshes, good and bad."""
    folder = tmp_path_factory.mktemp("insert")
    save_scene(floor_scene(), folder / "a.scene")
    box_file(folder / "box.ply")
    (folder / "in").mkdir()
    textured_obj(folder / "in", mtl="../secret.mtl")
    (folder / "edits.yaml").write_text(
        "- insert: {mesh: box.ply, at: [30, 28], material: mirror, turn: 20}\n- relight: {rotate: 20}\n"
    )
    return folder


def test_insert_writes_picture_and_scene(run, folder, tmp_path):
    scene, out = folder / "a.scene", tmp_path / "out.exr"
    code, shown, err = run(
        "insert", scene, folder / "box.ply", "--at", "12,28", "--at", "36,28", "--material", "0.1,0.2,0.7", "--spp", 6,
        "--json", "-o", out, "--save", tmp_path / "b.scene",
    )  # fmt: skip
    assert code == 0, err
    facts = json.loads(shown.splitlines()[-1])
    assert [edit["at"] for edit in facts["edits"]] == [[12, 28], [36, 28]]
    picture, photo = read_exr(out), load_scene(scene).photo.original
    assert np.abs(picture - photo).max(-1).sum() > 10
    np.testing.assert_array_equal(picture[:4], photo[:4])
    saved = load_scene(tmp_path / "b.scene")
    assert len(saved.bodies) == 2 and saved.bodies[0].name


def test_a_recipe_inserts(run, folder, tmp_path):
    code, shown, err = run(
        "apply", folder / "a.scene", folder / "edits.yaml", "--spp", 6, "--json", "-o", tmp_path / "out.png"
    )
    assert code == 0, err
    facts = json.loads(shown.splitlines()[-1])
    assert [edit["kind"] for edit in facts["edits"]] == ["insert", "light"]
    assert facts["edits"][0]["material"] == "mirror"
    (tmp_path / "bad.yaml").write_text("- insert: {mesh: box.ply}\n")
    code, _, err = run("apply", folder / "a.scene", tmp_path / "bad.yaml", "-o", tmp_path / "no.png")
    assert code == 2 and "needs its at" in err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["box.ply", "--at", "400,3"], "outside the photo"),
        (["box.ply", "--at", "here"], "2 numbers"),
        (["gone.ply", "--at", "12,28"], "cannot be read"),
        (["in/quad.obj", "--at", "12,28"], "never followed"),
        (["box.ply", "--at", "12,28", "--material", "wood"], "as-is, glass, mirror"),
        (["box.ply", "--at", "12,28", "--scale", "0"], "scale"),
    ],
)
def test_bad_input_writes_nothing(run, folder, tmp_path, arguments, sentence):
    mesh, *rest = arguments
    for command, out in (("insert", tmp_path / "out.png"), ("drop", tmp_path / "frames")):
        code, shown, err = run(command, folder / "a.scene", folder / mesh, *rest, "-o", out)
        assert code == 2 and sentence in err and not shown
        assert "Traceback" not in err and not out.exists()


def test_drop_films_into_a_folder(run, folder, tmp_path):
    pytest.importorskip("mujoco")
    code, shown, err = run(
        "drop", folder / "a.scene", folder / "box.ply", "--at", "24,28", "--frames", 3, "--fps", 3, "--spp", 4,
        "--height", 0.3, "--material", "#aa3311", "--json", "-o", tmp_path / "film", "--save", tmp_path / "end.scene",
    )  # fmt: skip
    assert code == 0, err
    facts = json.loads(shown.splitlines()[-1])
    frames = sorted((tmp_path / "film").glob("*.png"))
    assert len(frames) == facts["frames"] == 3
    first, last = (np.asarray(Image.open(f)).astype(float) for f in (frames[0], frames[-1]))
    assert np.abs(first - last).max() > 20
    assert len(load_scene(tmp_path / "end.scene").bodies) == 1


@pytest.mark.parametrize("out", ["same", "same/film"])
def test_a_film_is_not_written_into_its_scene(run, folder, tmp_path, out):
    code, _, err = run(
        "drop", folder / "a.scene", folder / "box.ply", "--at", "24,28", "-o", tmp_path / out, "--save",
        tmp_path / "same",
    )  # fmt: skip
    assert code == 2 and "put it beside" in err and not (tmp_path / "same").exists()
