"""select, edit, relight, glass, remove, insert, drop and apply on a small scene: files, exit codes, one error table."""

import sys

import numpy as np
import pytest
from edit_scenes import MASK, rendered_scene
from made_meshes import box_file, floor_scene, textured_obj
from PIL import Image

from materialist.color import linear_to_srgb, srgb_levels
from materialist.edits.insert.insert import insert
from materialist.edits.select import objects
from materialist.io import package
from materialist.io.exr import read_exr, write_exr
from materialist.io.package import load_scene, save_scene
from materialist.io.photo import read_photo
from materialist.render import variant

pytestmark = pytest.mark.usefixtures("filled_smoothly")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Scenes, masks that fit and that do not, environment maps, meshes, lists of edits; only read."""
    folder = tmp_path_factory.mktemp("pictures")
    save_scene(rendered_scene(block=3.0), folder / "a.scene")
    save_scene(floor_scene(), folder / "floor.scene")
    for name, mask in (
        ("block", MASK),
        ("empty", MASK & False),
        ("all", MASK | True),
        ("square", np.ones((36, 36))),
    ):
        Image.fromarray((mask * 255).astype(np.uint8)).save(folder / f"{name}.png")
    write_exr(folder / "square.exr", np.ones((32, 32, 3), np.float32))
    write_exr(folder / "sky.exr", np.full((16, 32, 3), 0.5, np.float32))
    write_exr(folder / "thick.exr", np.full((36, 48), 0.3, np.float32))
    write_exr(folder / "wall.exr", np.full((36, 48, 3), 0.25, np.float32))
    box_file(folder / "box.ply")
    (folder / "in").mkdir()
    textured_obj(folder / "in", mtl="../secret.mtl")
    recipes = {
        "edits": "- edit: {mask: block.png, value: -0.5}\n- relight: {rotate: 30}\n"
        "- relight: {ambient: 0.5, skip: true}\n- insert: {mesh: box.ply, at: [30, 28], material: mirror, turn: 20}\n",
        "dim": "- relight: {dim: 0.2, mask: block.png}\n",
        "glass": "- glass: {mask: block.png, ior: 1.2, tint: [1, 0.9, 1], hollow: true, thickness: symmetry}\n",
        "nowhere": "- insert: {mesh: box.ply}\n",
        "ior": "- remove: {mask: block.png, ior: 2}\n",
    }
    for name, text in recipes.items():
        (folder / f"{name}.yaml").write_text(text)
    return folder


def test_edit_writes_the_photo_with_only_the_block_changed(done, folder, tmp_path):
    scene = folder / "a.scene"
    out = tmp_path / "out.exr"
    options = "--value -0.5 --roughness +0.2 --spp 4 --seed 2"
    outcome = done(
        "edit",
        scene,
        "--mask",
        folder / "block.png",
        *options.split(),
        "-o",
        out,
        "--save",
        tmp_path / "b.scene",
    )
    assert outcome["image"] == str(out) and outcome["edits"][0]["roughness"] == "+0.2"
    picture = read_exr(out)
    photo = load_scene(scene).photo.original
    np.testing.assert_array_equal(picture[:8], photo[:8])
    assert (picture[MASK] < photo[MASK]).all()
    saved = load_scene(tmp_path / "b.scene")
    np.testing.assert_array_equal(saved.photo.original, picture)
    assert saved.provenance["edits"] == outcome["edits"]


def test_a_no_op_png_has_the_bytes_of_the_photo_and_a_full_render_has_not(done, folder, tmp_path):
    common = [
        "edit",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--roughness",
        "+0",
        "--spp",
        4,
    ]
    done(*common, "-o", tmp_path / "o.png")
    photo = np.round(linear_to_srgb(load_scene(folder / "a.scene").photo.original) * 255).astype(
        np.uint8
    )
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "o.png")), photo)
    done(*common, "--full-render", "--no-denoise", "-o", tmp_path / "b.png")
    full = np.asarray(Image.open(tmp_path / "b.png"))
    assert full.shape == photo.shape and (full[:8] != photo[:8]).any()
    (tmp_path / "f.py").write_text("def twice(p):\n    return p.repeat(2, 0).repeat(2, 1)\n")
    large = ["--full-render", "--no-denoise", "--upscale", f"{tmp_path / 'f.py'}:twice"]
    done(*common, *large, "-o", tmp_path / "l.png")
    np.testing.assert_array_equal(
        np.asarray(Image.open(tmp_path / "l.png")), full.repeat(2, 0).repeat(2, 1)
    )


def test_a_picture_without_the_denoiser_says_so(run, done, folder, tmp_path, monkeypatch):
    command = ["edit", folder / "a.scene", "--mask", folder / "block.png", "--value", "-0.5"]
    command += ["--spp", 4, "-o", tmp_path / "o.png"]
    assert done(*command)["denoised"] is True
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    facts = done(*command, "--force")
    assert facts["denoised"] is False
    assert any("not denoised" in note for note in facts["warnings"])
    assert "Note: The picture is not denoised" in run(*command, "--force")[1]
    facts = done(*command, "--force", "--no-denoise")
    assert facts["denoised"] is False and facts["warnings"] == []


@pytest.mark.parametrize("command", ["edit", "render"])
def test_an_explicit_wish_for_the_denoiser_fails_before_the_work(
    command, refused, folder, tmp_path, monkeypatch
):
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    monkeypatch.setattr(package, "load_scene", lambda path: pytest.fail("the work was begun"))
    region = ["--mask", folder / "block.png", "--value", "-0.5"] if command == "edit" else []
    error = refused(command, folder / "a.scene", *region, "--denoise", "-o", tmp_path / "o.png")
    assert "pip install pyoidn" in error
    assert not (tmp_path / "o.png").exists()


def test_apply_replays_the_list(run, done, folder, tmp_path):
    command = [
        "apply",
        folder / "a.scene",
        folder / "edits.yaml",
        "--spp",
        4,
        "-o",
        tmp_path / "o.png",
    ]
    assert [e["kind"] for e in done(*command)["edits"]] == ["material", "light", "insert"]
    assert "3 edits applied, 1 skipped." in run(*command, "--force")[1]


def test_relight_dims_the_lights_that_are_meant(done, folder, tmp_path):
    scene = folder / "a.scene"
    for command in (
        ["relight", scene, "--dim", 0.2, "--mask", folder / "block.png"],
        ["apply", scene, folder / "dim.yaml"],
    ):
        done(*command, "--spp", 4, "--no-denoise", "-o", tmp_path / f"{command[0]}.exr")
    one, other = (read_exr(tmp_path / name) for name in ("relight.exr", "apply.exr"))
    inner = tuple(np.argwhere(MASK).mean(0).astype(int))
    np.testing.assert_allclose(one[inner], 0.2 * load_scene(scene).photo.original[inner], rtol=0.02)
    np.testing.assert_allclose(one, other, rtol=1e-3, atol=1e-3)


def test_relight_by_map_lamp_and_frames(done, folder, tmp_path):
    relight = ["relight", folder / "a.scene", "--spp", 4]
    done(*relight, "--envmap", folder / "sky.exr", "--gain", 1, "-o", tmp_path / "o.exr")
    assert (
        read_exr(tmp_path / "o.exr").mean()
        < 0.6 * load_scene(folder / "a.scene").photo.original.mean()
    )
    done(*relight, "--lamp", "10,10,2.5,3000,1", "--ambient", 0.5, "-o", tmp_path / "l.png")
    done(*relight, "--rotate", 90, "--frames", 3, "--no-denoise", "-o", tmp_path / "turn")
    assert sorted(p.name for p in (tmp_path / "turn").iterdir()) == [
        f"{k:04d}.png" for k in range(3)
    ]


@pytest.mark.parametrize("factor, notes", [(0.5, 0), (1, 1)])
def test_a_film_is_judged_by_the_frame_that_changes_most(
    done, folder, tmp_path, monkeypatch, factor, notes
):
    photo = load_scene(folder / "a.scene").photo.original

    def made(scene, film, **_):
        return (photo * np.float32(one) for _, one in zip(film, (1, factor, 1)))

    monkeypatch.setattr("materialist.edits.composite.composite.pictures", made)
    outcome = done(
        "relight", folder / "a.scene", "--rotate", 360, "--frames", 3, "-o", tmp_path / "turn"
    )
    assert str(outcome["warnings"]).count("of 255 levels") == notes


def test_select_writes_a_mask_that_edit_reads(done, folder, tmp_path, monkeypatch):
    select = ["select", folder / "a.scene"]
    assert (
        done(*select, "--mask", folder / "block.png", "-o", tmp_path / "m.png")["pixels"]
        == MASK.sum()
    )
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "m.png"))[..., 0] == 255, MASK)
    # In place of MobileSAM, which takes seconds.
    logits = np.where(MASK, 1, -1)[None].repeat(3, 0).astype(np.float32)
    monkeypatch.setattr(objects.sam, "masks", lambda *_, **__: (logits, np.ones(3)))
    done(*select, "--click", "17,17", "--native", "-o", tmp_path / "n.png")
    assert np.asarray(Image.open(tmp_path / "n.png"))[17, 17, 0] == 255


def test_a_region_takes_its_options_to_select(done, folder, tmp_path, monkeypatch):
    seen = {}

    def chosen(scene, **where):
        seen.update(where)
        return MASK

    monkeypatch.setattr("materialist.select", chosen)
    narrowed = ("--click", "17,17", "--same-material", "--exclude", "20,21", "--exclude", "22,23")
    done("select", folder / "a.scene", *narrowed, "-o", tmp_path / "m.png")
    assert seen["same_material"] is True and seen["exclude"] == ((20, 21), (22, 23))


def test_glass_is_written_saved_and_loaded_again(done, folder, tmp_path):
    out = tmp_path / "g.exr"
    saved = tmp_path / "g.scene"
    made = done(
        "glass",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--ior",
        1.4,
        "--tint",
        "#80ff80",
        "--thickness",
        folder / "thick.exr",
        "--spp",
        4,
        "-o",
        out,
        "--save",
        saved,
    )["edits"][-1]
    assert made["kind"] == "glass" and made["ior"] == 1.4 and made["thickness"] == "given"
    picture = read_exr(out)
    scene = load_scene(saved)
    assert (picture[MASK] != load_scene(folder / "a.scene").photo.original[MASK]).any()
    np.testing.assert_array_equal(scene.photo.original, picture)
    (body,) = scene.bodies
    assert body.surface.ior == pytest.approx(1.4) and body.surface.tint[1] == pytest.approx(1)
    outcome = done(
        "apply", folder / "a.scene", folder / "glass.yaml", "--spp", 4, "-o", tmp_path / "1.exr"
    )
    assert outcome["edits"][-1]["hollow"] is True


def test_remove_with_a_background_shows_it(done, folder, tmp_path):
    done(
        "remove",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--background",
        folder / "wall.exr",
        "--spp",
        16,
        "-o",
        tmp_path / "r.exr",
    )
    assert abs(read_exr(tmp_path / "r.exr")[MASK].mean() - 0.25) < 0.03


def test_insert_writes_picture_and_scene(done, folder, tmp_path):
    scene = folder / "floor.scene"
    out = tmp_path / "out.exr"
    outcome = done(
        "insert",
        scene,
        folder / "box.ply",
        "--at",
        "12,28",
        "--at",
        "36,28",
        "--material",
        "0.1,0.2,0.7",
        "--spp",
        4,
        "-o",
        out,
        "--save",
        tmp_path / "b.scene",
    )
    assert [edit["at"] for edit in outcome["edits"]] == [[12, 28], [36, 28]]
    picture = read_exr(out)
    photo = load_scene(scene).photo.original
    assert np.abs(picture - photo).max(-1).sum() > 10
    np.testing.assert_array_equal(picture[:4], photo[:4])
    assert len(load_scene(tmp_path / "b.scene").bodies) == 2


@pytest.mark.slow
def test_drop_films_into_a_folder(done, folder, tmp_path):
    pytest.importorskip("mujoco")
    outcome = done(
        "drop",
        folder / "floor.scene",
        folder / "box.ply",
        "--at",
        "24,28",
        "--frames",
        3,
        "--fps",
        3,
        "--spp",
        4,
        "--height",
        0.3,
        "--material",
        "#aa3311",
        "-o",
        tmp_path / "film",
        "--save",
        tmp_path / "end.scene",
    )
    frames = sorted((tmp_path / "film").glob("*.png"))
    assert len(frames) == outcome["frames"] == 3
    first, last = (np.asarray(Image.open(f)).astype(float) for f in (frames[0], frames[-1]))
    assert np.abs(first - last).max() > 20
    assert len(load_scene(tmp_path / "end.scene").bodies) == 1
    outcome = done(
        "drop",
        folder / "floor.scene",
        folder / "box.ply",
        "--at",
        "24,28",
        "--frames",
        2,
        "--spp",
        4,
        "--rotate",
        "-90..90",
        "-o",
        tmp_path / "turned",
    )
    assert [edit.get("rotate") for edit in outcome["edits"]] == [None, 90]


EDIT = ("edit", "a.scene")
RELIGHT = ("relight", "a.scene")
GLASS = ("glass", "a.scene", "--mask", "block.png")
HUE = (*EDIT, "--mask", "block.png", "--hue", "9")
TURN = (*RELIGHT, "--rotate", "9")
INSERT = ("insert", "floor.scene")
DROP = ("drop", "floor.scene")


@pytest.mark.parametrize(
    ("arguments", "out", "words"),
    [
        ((*EDIT, "--mask", "square.png", "--hue", "9"), "out.png", "36 x 36"),
        ((*EDIT, "--hue", "9"), "out.png", "exactly one"),
        ((*EDIT, "--mask", "block.png"), "out.png", "Nothing to change"),
        (
            (*HUE, "--texture-scale", "2"),
            "out.png",
            "--texture-scale says nothing without --texture",
        ),
        (HUE, "out.gif", ".png"),
        (("edit", "nothing.scene", *HUE[2:]), "out.png", "nothing.scene"),
        ((*HUE, "--save", "a.scene"), "out.png", "--force"),
        ((*HUE, "--save", "out.scene"), "out.scene/a.png", "beside"),
        ((*HUE, "--full-render", "--save", "out.scene"), "out.png", "leave one of them out"),
        (
            (*HUE, "--upscale", "box.ply:f"),
            "out.png",
            "--upscale says nothing without --full-render",
        ),
        (RELIGHT, "out.png", "Nothing to change; give --envmap"),
        ((*RELIGHT, "--sun", "10,100"), "out.png", "elevation is 100"),
        ((*TURN, "--frames", "4"), "out.png", ".mp4"),
        ((*RELIGHT, "--rotate", "1..9"), "out.png", "one picture has one number"),
        (TURN, "out.mp4", "--frames 48"),
        ((*TURN, "--sun-power", "2"), "out.png", "--sun-power says nothing without --sun"),
        ((*TURN, "--mask", "block.png"), "out.png", "--mask says nothing without --dim"),
        ((*TURN, "--frames", "4", "--full-render", "--spp", "0"), "out", "--spp"),
        (("apply", "a.scene", "none.yaml"), "out.png", "none.yaml"),
        (("apply", "a.scene", "nowhere.yaml"), "out.png", "needs its at"),
        (("apply", "a.scene", "ior.yaml"), "out.png", "'ior'"),
        (("select", "a.scene", "--click", "1,1"), "out.exr", ".png"),
        ((*GLASS, "--thickness", "none.exr"), "out.png", "none.exr"),
        ((*GLASS, "--model", "two-interface", "--full-render"), "out.png", "--model closed"),
        ((*GLASS, "--back", "same"), "out.png", "only the two-interface model"),
        (("glass", "a.scene", "--mask", "all.png"), "out.png", "mark one object only"),
        ((*INSERT, "in/quad.obj", "--at", "12,28"), "out.png", "never followed"),
        (
            (*DROP, "box.ply", "--at", "12,28", "--gravity", "0,1"),
            "film",
            "gravity must be 3 numbers",
        ),
        (
            (*DROP, "box.ply", "--at", "24,28", "--save", "out.scene"),
            "out.scene/film",
            "put it beside",
        ),
    ],
)
def test_bad_input_is_one_sentence_with_exit_2_and_nothing_is_written(
    refused, folder, tmp_path, arguments, out, words
):
    def named(word):
        return "." in word and not word.replace(".", "").replace(",", "").isdigit()

    def place(word):
        return (tmp_path if word.startswith("out") else folder) / word

    before = sorted(folder.rglob("*"))
    err = refused(
        *(place(word) if named(word) else word for word in arguments), "-o", tmp_path / out
    )
    assert err.startswith("Error: ") and words in err
    assert sorted(folder.rglob("*")) == before and not list(tmp_path.iterdir())


def test_the_device_is_chosen_before_anything_renders(done, folder, tmp_path, monkeypatch):
    """A GPU machine must not begin on its GPU and then be told of the CPU."""
    save_scene(
        insert(load_scene(folder / "a.scene"), folder / "box.ply", (6, 30), scale=0.3),
        tmp_path / "c.scene",
    )
    asked = []
    setup = variant.setup
    monkeypatch.setattr(
        variant, "setup", lambda device="auto": asked.append(device) or setup(device)
    )
    options = ["--spp", "4", "--device", "cpu", "-o", tmp_path / "out.png"]
    done("edit", tmp_path / "c.scene", "--mask", folder / "block.png", "--value", "0.1", *options)
    assert asked[:1] == ["cpu"]


@pytest.mark.parametrize("kind", ["jpg", "tif", "webp", "avif"])
def test_pictures_of_every_kind(kind, done, folder, tmp_path):
    command = [
        "edit",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--value",
        "-0.5",
        "--spp",
        4,
    ]
    quality = [] if kind == "tif" else ["--quality", 100]
    done(*command, *quality, "-o", tmp_path / f"o.{kind}")
    shown = np.asarray(Image.open(tmp_path / f"o.{kind}"), np.int16)
    photo = srgb_levels(load_scene(folder / "a.scene").photo.original)
    assert np.abs(shown[:8] - photo[:8]).max() <= (0 if kind in ("tif", "webp") else 12)
    assert (shown[MASK] < photo[MASK]).mean() > 0.9


def test_layers_of_an_edit_a_rendering_and_the_photo(done, refused, folder, tmp_path):
    edit = [
        "edit",
        folder / "a.scene",
        "--mask",
        folder / "block.png",
        "--value",
        "-0.5",
        "--spp",
        4,
        "--exr-layers",
    ]
    done(*edit, "-o", tmp_path / "edit.exr")
    render = ["render", folder / "a.scene", "--spp", 4, "--exr-layers"]
    done(*render, "-o", tmp_path / "render.exr")
    done(*render, "--photo", "-o", tmp_path / "photo.exr")
    photo = load_scene(folder / "a.scene").photo.original
    beauty = {name: read_photo(tmp_path / f"{name}.exr") for name in ("edit", "render", "photo")}
    assert all("beauty" in read.layer for read in beauty.values())
    assert np.allclose(beauty["photo"].original * 2.0 ** -beauty["photo"].stops, photo)
    assert "--exr-layers writes an .exr" in refused(*edit, "-o", tmp_path / "o.png")
    assert "--photo says nothing without" in refused(
        *render[:-1], "--photo", "-o", tmp_path / "o.exr"
    )


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--quality", 80), "quality is 80"),
        (("--bits", 12), "12 bits"),
        (("--exr-layers",), "--exr-layers writes an .exr"),
    ],
)
def test_encodings_are_refused_before_the_work(
    flags, words, refused, folder, tmp_path, monkeypatch
):
    monkeypatch.setattr(package, "load_scene", lambda path: pytest.fail("the work was begun"))
    assert words in refused("render", folder / "a.scene", *flags, "-o", tmp_path / "o.png")


def test_a_film_has_no_quality(refused, folder, tmp_path):
    command = [
        "relight",
        folder / "a.scene",
        "--frames",
        2,
        "-o",
        tmp_path / "film",
        "--quality",
        80,
    ]
    assert "are of pictures" in refused(*command)
