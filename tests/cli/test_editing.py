"""select, edit, relight and apply on a small scene: files, exit codes, and nothing written on bad input."""

import json

import numpy as np
import pytest
from edit_scenes import block_mask, rendered_scene
from PIL import Image

from materialist.cli import app
from materialist.cli.outcome import run_to_exit_code
from materialist.cli.picture import is_unseen
from materialist.io.exr import read_exr, write_exr
from materialist.io.package import load_scene, save_scene

MASK = block_mask(36, 48)


@pytest.fixture
def run(capsys):
    """Run a command line; returns (exit code, stdout, stderr)."""

    def call(*arguments):
        code = run_to_exit_code(app, [str(argument) for argument in arguments])
        shown = capsys.readouterr()
        return code, shown.out, shown.err

    return call


@pytest.fixture
def folder(tmp_path):
    """A scene, a mask of its block, masks that do not fit, and environment maps."""
    save_scene(rendered_scene(block=3.0), tmp_path / "a.scene")
    Image.fromarray((MASK * 255).astype(np.uint8)).save(tmp_path / "block.png")
    Image.fromarray(np.zeros((36, 48), np.uint8)).save(tmp_path / "empty.png")
    Image.fromarray(np.full((36, 36), 255, np.uint8)).save(tmp_path / "square.png")
    write_exr(tmp_path / "square.exr", np.ones((32, 32, 3), np.float32))
    write_exr(tmp_path / "sky.exr", np.full((16, 32, 3), 0.5, np.float32))
    (tmp_path / "edits.yaml").write_text("- edit: {mask: block.png, value: -0.5}\n- relight: {rotate: 30}\n")
    (tmp_path / "bad.yaml").write_text("- edit: {mask: block.png, shininess: 1}\n")
    return tmp_path


def test_edit_writes_the_photo_with_only_the_block_changed(run, folder):
    scene, out = folder / "a.scene", folder / "out.exr"
    options = "--value -0.5 --roughness +0.2 --spp 6 --seed 2 --json"
    code, shown, err = run(
        "edit", scene, "--mask", folder / "block.png", *options.split(), "-o", out, "--save", folder / "b.scene"
    )
    assert code == 0, err
    facts = json.loads(shown.splitlines()[-1])
    assert facts["image"] == str(out) and facts["edits"][0]["roughness"] == "+0.2"
    picture, photo = read_exr(out), load_scene(scene).photo.original
    np.testing.assert_array_equal(picture[:8], photo[:8])
    assert (picture[MASK] < photo[MASK]).all()
    saved = load_scene(folder / "b.scene")
    np.testing.assert_array_equal(saved.photo.original, picture)
    assert saved.provenance["edits"] == facts["edits"]


def test_a_no_op_png_has_the_bytes_of_the_photo(run, folder):
    code, _, err = run(
        "edit",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--roughness",
        "+0",
        "--spp",
        4,
        "-o",
        folder / "o.png",
    )
    assert code == 0, err
    from materialist.color import linear_to_srgb

    photo = np.round(linear_to_srgb(load_scene(folder / "a.scene").photo.original) * 255).astype(np.uint8)
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "o.png")), photo)


def test_full_render_is_another_picture_of_the_same_size(run, folder):
    common = ["edit", folder / "a.scene", "--mask", folder / "block.png", "--value", "0.1", "--spp", 4]
    assert run(*common, "-o", folder / "a.exr")[0] == 0
    assert run(*common, "--full-render", "--no-denoise", "-o", folder / "b.exr")[0] == 0
    a, b = read_exr(folder / "a.exr"), read_exr(folder / "b.exr")
    assert a.shape == b.shape and (a[:8] != b[:8]).any()


def test_apply_replays_the_list(run, folder):
    code, shown, err = run(
        "apply", folder / "a.scene", folder / "edits.yaml", "--spp", 4, "-o", folder / "o.exr", "--json"
    )
    assert code == 0, err
    assert [e["kind"] for e in json.loads(shown.splitlines()[-1])["edits"]] == ["material", "light"]
    (folder / "one.yaml").write_text("- relight: {ambient: 0.9}\n- relight: {ambient: 0.5, skip: true}\n")
    shown = run("apply", folder / "a.scene", folder / "one.yaml", "--spp", 4, "-o", folder / "one.exr")[1]
    assert "1 edit applied, 1 skipped." in shown


def test_relight_dims_the_lights_that_are_meant(run, folder):
    scene = folder / "a.scene"
    (folder / "dim.yaml").write_text("- relight: {dim: 0.2, mask: block.png}\n")
    (folder / "not.yaml").write_text("- relight: {rotate: 20, mask: block.png}\n")
    for command in (
        ["relight", scene, "--dim", 0.2, "--mask", folder / "block.png"],
        ["apply", scene, folder / "dim.yaml"],
    ):
        assert run(*command, "--spp", 8, "--no-denoise", "-o", folder / f"{command[0]}.exr")[0] == 0
    one, other = (read_exr(folder / name) for name in ("relight.exr", "apply.exr"))
    inner = np.argwhere(MASK).mean(0).astype(int)
    before = load_scene(scene).photo.original[tuple(inner)]
    np.testing.assert_allclose(one[tuple(inner)], 0.2 * before, rtol=0.02)
    np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3)
    code, _, err = run("apply", scene, folder / "not.yaml", "-o", folder / "n.png")
    assert code == 2 and "give dim" in err and not (folder / "n.png").exists()


def test_relight_by_map_lamp_and_frames(run, folder):
    scene = folder / "a.scene"
    assert (
        run("relight", scene, "--envmap", folder / "sky.exr", "--gain", 1, "--spp", 4, "-o", folder / "o.exr")[0] == 0
    )
    darker = read_exr(folder / "o.exr")
    assert darker.mean() < 0.6 * load_scene(scene).photo.original.mean()
    code, _, err = run(
        "relight", scene, "--lamp", "10,10,2.5,3000,1", "--ambient", 0.5, "--spp", 4, "-o", folder / "l.png"
    )
    assert code == 0, err
    code, _, err = run("relight", scene, "--rotate", 90, "--frames", 2, "--spp", 2, "-o", folder / "turn")
    assert code == 0, err
    assert sorted(p.name for p in (folder / "turn").iterdir()) == ["0000.png", "0001.png"]


def test_a_film_holds_one_relit_scene_at_a_time(run, folder, monkeypatch):
    """Each has an environment map of its own, and a film thousands of frames."""
    import weakref

    from materialist.edits.light import frames

    alive, most, make = [], [], frames.relight

    def relit(*arguments, **options):
        scene = make(*arguments, **options)
        alive.append(weakref.ref(scene))
        most.append(sum(one() is not None for one in alive))
        return scene

    monkeypatch.setattr(frames, "relight", relit)
    code, _, err = run(
        "relight", folder / "a.scene", "--rotate", 90, "--frames", 6, "--spp", 2, "--no-denoise", "-o", folder / "film"
    )
    assert code == 0, err
    assert len(most) == 6 and max(most) <= 3


def test_an_edit_that_nobody_sees_is_told(run, folder):
    edit = ["edit", folder / "a.scene", "--mask", folder / "block.png", "--spp", 4, "-o", folder / "o.png", "--force"]
    assert "nothing of the edit is to be seen" in run(*edit, "--roughness", "+0")[1]
    assert "to be seen" not in run(*edit, "--value", "-0.3")[1]
    sun = ["relight", folder / "a.scene", "--spp", 4, "-o", folder / "o.png", "--force", "--sun"]
    behind_the_wall = run(*sun, "0,10")[1]
    assert "nothing of the edit is to be seen" in behind_the_wall and "--sun 180,40" in behind_the_wall
    assert "to be seen" not in run(*sun, "180,40")[1]


def test_pictures_that_look_the_same():
    rng = np.random.default_rng(0)
    photo = rng.uniform(0.2, 0.8, (100, 100, 3)).astype(np.float32)
    changed = photo.copy()
    changed[5, :5] += 0.1
    assert is_unseen(photo, photo) and is_unseen(photo + 1e-5, photo) and is_unseen(photo, photo, relit=True)
    assert not is_unseen(changed, photo) and is_unseen(changed, photo, relit=True)
    assert not is_unseen(0.9 * photo, photo, relit=True)


def test_select_writes_a_mask_that_edit_reads(run, folder):
    code, shown, err = run(
        "select", folder / "a.scene", "--mask", folder / "block.png", "-o", folder / "m.png", "--json"
    )
    assert code == 0, err
    assert json.loads(shown.splitlines()[-1])["pixels"] == MASK.sum()
    np.testing.assert_array_equal(np.asarray(Image.open(folder / "m.png"))[..., 0] == 255, MASK)
    assert run("select", folder / "a.scene", "--click", "17,17", "--native", "-o", folder / "n.png")[0] == 0


EDIT = ["edit", "SCENE", "-o", "OUT.png"]
RELIGHT = ["relight", "SCENE", "-o", "OUT.png"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([*EDIT, "--mask", "square.png", "--hue", "9"], "36 x 36"),
        ([*EDIT, "--mask", "empty.png", "--hue", "9"], "empty"),
        ([*EDIT, "--mask", "none.png", "--hue", "9"], "none.png"),
        ([*EDIT, "--click", "500,5", "--hue", "9"], "outside"),
        ([*EDIT, "--click", "five", "--hue", "9"], "--click"),
        ([*EDIT, "--hue", "9"], "exactly one"),
        ([*EDIT, "--mask", "block.png"], "Nothing to change"),
        ([*EDIT, "--mask", "block.png", "--roughness", "3"], "roughness is 3"),
        ([*EDIT, "--mask", "block.png", "--albedo", "1,2"], "R,G,B"),
        ([*EDIT, "--mask", "block.png", "--texture", "none.png"], "none.png"),
        ([*EDIT, "--mask", "block.png", "--hue", "9", "--spp", "1"], "--spp"),
        (["edit", "SCENE", "--mask", "block.png", "--hue", "9", "-o", "OUT.gif"], ".png"),
        (["edit", "nothing.scene", "--mask", "block.png", "--hue", "9", "-o", "OUT.png"], "nothing.scene"),
        ([*EDIT, "--mask", "block.png", "--hue", "9", "--save", "SCENE"], "--force"),
        (
            ["edit", "SCENE", "--mask", "block.png", "--hue", "9", "-o", "out.scene/a.png", "--save", "out.scene"],
            "beside",
        ),
        ([*EDIT, "--mask", "block.png", "--hue", "9", "--full-render", "--save", "out.scene"], "leave one of them out"),
        (RELIGHT, "No light"),
        ([*RELIGHT, "--envmap", "square.exr"], "twice as wide"),
        ([*RELIGHT, "--envmap", "none.exr"], "none.exr"),
        ([*RELIGHT, "--sun", "10,100"], "elevation is 100"),
        ([*RELIGHT, "--lamp", "1,2,3"], "--lamp"),
        ([*RELIGHT, "--lamp", "1,2,3,99999,1"], "99999"),
        ([*RELIGHT, "--rotate", "9", "--frames", "4"], ".mp4"),
        (["relight", "SCENE", "--rotate", "9", "--frames", "1", "-o", "OUT"], "frames is 1"),
        (["relight", "SCENE", "--rotate", "9", "-o", "out.mp4"], "--frames 48"),
        ([*RELIGHT, "--rotate", "9", "--gain", "2"], "--gain says nothing without --envmap"),
        ([*RELIGHT, "--rotate", "9", "--sun-power", "2"], "--sun-power says nothing without --sun"),
        ([*RELIGHT, "--rotate", "9", "--fps", "7"], "--fps says nothing without --frames"),
        ([*RELIGHT, "--rotate", "9", "--mask", "block.png"], "--mask says nothing without --dim"),
        ([*RELIGHT, "--dim", "0.5", "--mask", "empty.png"], "empty"),
        ([*EDIT, "--hue", "9", "--texture-scale", "2"], "--texture-scale says nothing without --texture"),
        (["relight", "SCENE", "--rotate", "9", "--frames", "4", "--full-render", "--spp", "0", "-o", "OUT"], "--spp"),
        (["relight", "SCENE", "--rotate", "9", "--frames", "4", "--fps", "0", "-o", "OUT"], "--fps"),
        (["apply", "SCENE", "bad.yaml", "-o", "OUT.png"], "shininess"),
        (["apply", "SCENE", "none.yaml", "-o", "OUT.png"], "none.yaml"),
        (["select", "SCENE", "--click", "1,1", "-o", "OUT.exr"], ".png"),
        (["select", "SCENE", "-o", "OUT.png"], "exactly one"),
    ],
)
def test_bad_input_is_exit_2_and_nothing_is_written(run, folder, arguments, words):
    before = sorted(p.name for p in folder.iterdir())
    names = {"SCENE": "a.scene", "OUT": "out", "OUT.png": "out.png", "OUT.gif": "out.gif", "OUT.exr": "out.exr"}
    files = {p.name for p in folder.iterdir()} | {"none.png", "none.exr", "none.yaml", "nothing.scene"}
    filled = [names.get(a, a) for a in arguments]
    filled = [folder / a if a in files or a.startswith("out") else a for a in filled]
    code, _, err = run(*filled)
    assert code == 2 and words in err and "Traceback" not in err, err
    assert err.count("\n") == 1
    assert sorted(p.name for p in folder.iterdir()) == before


@pytest.mark.parametrize(
    "command", ["select", "edit", "relight", "apply", "insert", "drop", "glass", "remove", "export"]
)
def test_help(run, command):
    code, out, _ = run(command, "--help")
    assert code == 0 and all(option in out for option in ("--json", "--seed", "--device", "--force"))


def test_the_device_is_chosen_before_anything_renders(run, folder, monkeypatch):
    """A GPU machine must not begin on its GPU and then be told of the CPU."""
    from made_meshes import box_file

    from materialist.edits.insert.insert import insert
    from materialist.render import variant

    box = box_file(folder / "box.ply")
    save_scene(insert(load_scene(folder / "a.scene"), box, (6, 30), scale=0.3), folder / "c.scene")
    asked, setup = [], variant.setup
    monkeypatch.setattr(variant, "setup", lambda device="auto": asked.append(device) or setup(device))
    options = ["--spp", "2", "--device", "cpu", "-o", folder / "out.png"]
    code, _, err = run("edit", folder / "c.scene", "--mask", folder / "block.png", "--value", "0.1", *options)
    assert code == 0, err
    assert asked[:1] == ["cpu"]


@pytest.mark.parametrize("seed", ["-1", "99999999999999999999"])
def test_seeds_that_no_generator_takes(run, folder, seed):
    before = sorted(folder.rglob("*"))
    code, _, err = run(
        "edit", folder / "a.scene", "--click", "20,20", "--hue", 20, "--seed", seed, "-o", folder / "a.png"
    )
    assert code == 2 and "'--seed'" in err and sorted(folder.rglob("*")) == before
