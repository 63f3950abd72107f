"""glass and remove on a small scene: files, exit codes, recipes, and nothing written on bad input."""

import json

import numpy as np
import pytest
from edit_scenes import block_mask, rendered_scene
from PIL import Image

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.edits.glass.preview import GlassPreview
from materialist.io.exr import read_exr, write_exr
from materialist.io.package import load_scene, save_scene

MASK = block_mask(36, 48)


@pytest.fixture
def run(capsys):
    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


@pytest.fixture
def folder(tmp_path):
    save_scene(rendered_scene(), tmp_path / "a.scene")
    for name, mask in (("block", MASK), ("empty", MASK & False), ("all", MASK | True)):
        Image.fromarray((mask * 255).astype(np.uint8)).save(tmp_path / f"{name}.png")
    write_exr(tmp_path / "thick.exr", np.full((36, 48), 0.3, np.float32))
    write_exr(tmp_path / "wall.exr", np.full((36, 48, 3), 0.25, np.float32))
    write_exr(tmp_path / "square.exr", np.full((36, 36, 3), 0.25, np.float32))
    return tmp_path


def test_glass_is_written_saved_and_loaded_again(run, folder):
    out, saved = folder / "g.exr", folder / "g.scene"
    code, shown, err = run(
        "glass", folder / "a.scene", "--mask", folder / "block.png", "--ior", 1.4, "--tint", "#80ff80", "--thickness",
        folder / "thick.exr", "--spp", 4, "--json", "-o", out, "--save", saved,
    )  # fmt: skip
    assert code == 0, err
    made = json.loads(shown.splitlines()[-1])["edits"][-1]
    assert made["kind"] == "glass" and made["ior"] == 1.4 and made["thickness"] == "given"
    picture, scene = read_exr(out), load_scene(saved)
    assert (picture[MASK] != load_scene(folder / "a.scene").photo.original[MASK]).any()
    np.testing.assert_array_equal(scene.photo.original, picture)
    (body,) = scene.bodies
    assert body.surface.ior == pytest.approx(1.4) and body.surface.tint[1] == pytest.approx(1)


def test_a_preview_is_a_picture_that_says_so(run, folder):
    command = ("glass", folder / "a.scene", "--mask", folder / "block.png", "--ior", 1.4, "--thickness", "symmetry")
    out = folder / "p.exr"
    code, shown, err = run(*command, "--preview", "--tint", "1,0.5,0.5", "-o", out)
    assert code == 0, err
    assert "A preview: 48 x 36" in shown and "without the shadow" in shown and "thickness: symmetry" in shown
    picture, scene = read_exr(out), load_scene(folder / "a.scene")
    truth = GlassPreview(scene, MASK, thickness="symmetry").picture(ior=1.4, tint=(1, 0.5, 0.5), spp=96)
    np.testing.assert_allclose(picture, truth, rtol=1e-5)
    code, shown, _ = run(*command, "--preview", "--json", "--force", "-o", out)
    told = json.loads(shown.splitlines()[-1])
    assert code == 0 and told["preview"] is True and told["scene"] is None and told["ior"] == 1.4
    for wrong in (("--save", folder / "s.scene"), ("--full-render",), ("--model", "two-interface")):
        code, _, err = run(*command, "--preview", *wrong, "-o", folder / "x.exr")
        assert code == 2 and ("--preview" in err or "closed" in err)
    assert not (folder / "x.exr").exists() and not (folder / "s.scene").exists()


def test_remove_with_a_background_shows_it(run, folder):
    out = folder / "r.exr"
    code, _, err = run(
        "remove", folder / "a.scene", "--mask", folder / "block.png", "--background", folder / "wall.exr", "--spp", 16,
        "-o", out,
    )  # fmt: skip
    assert code == 0, err
    assert abs(read_exr(out)[MASK].mean() - 0.25) < 0.03


def test_recipes_know_both(run, folder):
    (folder / "edits.yaml").write_text(
        "- glass: {mask: block.png, ior: 1.2, tint: [1, 0.9, 1], hollow: true, thickness: symmetry}\n"
    )
    code, shown, err = run(
        "apply", folder / "a.scene", folder / "edits.yaml", "--spp", 2, "--json", "-o", folder / "1.exr"
    )
    assert code == 0, err
    assert json.loads(shown.splitlines()[-1])["edits"][-1]["hollow"] is True
    (folder / "bad.yaml").write_text("- remove: {mask: block.png, ior: 2}\n")
    code, _, err = run("apply", folder / "a.scene", folder / "bad.yaml", "-o", folder / "2.exr")
    assert code == 2 and "'ior'" in err


@pytest.mark.parametrize(
    ("command", "options", "message"),
    [
        ("glass", ("--mask", "block.png", "--ior", "0.9"), "refraction is 0.9"),
        ("glass", ("--mask", "block.png", "--tint", "1,1"), "must be R,G,B"),
        ("glass", ("--mask", "block.png", "--thickness", "none.exr"), "give a file"),
        ("glass", ("--mask", "all.png"), "mark one object only"),
        ("remove", ("--mask", "empty.png"), "empty"),
        ("remove", ("--mask", "block.png", "--background", "square.exr"), "same proportions"),
        ("remove", ("--mask", "block.png", "--inpaint", "magic"), "give sd:FOLDER"),
        ("remove", (), "exactly one of"),
    ],
)
def test_bad_input_is_one_sentence_and_writes_nothing(run, folder, command, options, message):
    options = [folder / o if str(o).endswith((".png", ".exr")) else o for o in options]
    code, _, err = run(command, folder / "a.scene", *options, "-o", folder / "x.png")
    assert code == 2 and message in err and "Traceback" not in err, err
    assert not (folder / "x.png").exists()
