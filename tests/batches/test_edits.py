"""A batch's list of edits for one photo of it: names put in, and a key that knows the files behind them."""

import pytest
from made_batch import photos

from materialist.batches.edits import edits_for, edits_key
from materialist.batches.run import batch
from materialist.edits.recipe import read_recipe
from materialist.errors import InputError

TEXT = "- drop: {mesh: ['{name}.ply', ball.ply], at: [3, 4]}\n- edit: {mask: 'm/{name}.png', hue: 20}\n"


@pytest.fixture
def recipe(tmp_path):
    for name in ("a.ply", "b.ply", "ball.ply"):
        (tmp_path / name).write_text(name)
    (tmp_path / "edits.yaml").write_text(TEXT)
    return tmp_path / "edits.yaml"


def test_the_key_changes_with_a_mesh_and_with_nothing_else(recipe):
    key = edits_key(recipe, "a", 8)
    assert (
        edits_key(recipe, "a", 8) == key
        and edits_key(recipe, "b", 8) != key
        and edits_key(recipe, "a", 9) != key
    )
    (recipe.parent / "b.ply").write_text("of another photo")
    assert edits_key(recipe, "a", 8) == key
    (recipe.parent / "ball.ply").write_text("another ball")
    assert edits_key(recipe, "a", 8) != key


@pytest.mark.parametrize("changed", ["look/ball.mtl", "wood grain.png"])
def test_the_key_knows_the_materials_and_textures_of_a_mesh(tmp_path, changed):
    (tmp_path / "look").mkdir()
    (tmp_path / "look" / "ball.mtl").write_text("newmtl a\nmap_Kd wood grain.png\n")
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n"
    (tmp_path / "ball.obj").write_text(f"mtllib look/ball.mtl\n{triangle}")
    (tmp_path / "edits.yaml").write_text("- insert: {mesh: ball.obj, at: [3, 4]}\n")
    for name in ("wood grain.png", "nobody's.png"):
        (tmp_path / name).write_text(name)
    key = edits_key(tmp_path / "edits.yaml", "a", 8)
    (tmp_path / "nobody's.png").write_text("new")
    assert edits_key(tmp_path / "edits.yaml", "a", 8) == key
    (tmp_path / changed).write_text((tmp_path / changed).read_text() + " new\n")
    assert edits_key(tmp_path / "edits.yaml", "a", 8) != key


@pytest.mark.slow
def test_masks_that_are_missing_are_told_before_the_first_inversion(recipe):
    recipe.write_text("- edit: {mask: 'm/{name}.png', hue: 20}\n")
    source = photos(recipe.parent / "photos", "one", "two")
    runs = recipe.parent / "runs"
    said = []
    options = {
        "apply": recipe,
        "function": "made_batch:made_up",
        "workers": 1,
        "device": "cpu",
        "spp": 2,
    }
    with pytest.raises(InputError, match=r"no .*/m/one.png for one.png.*resume=True"):
        batch(source, runs, **options)
    assert not list(runs.glob("*.scene"))
    (recipe.parent / "m").mkdir()
    (recipe.parent / "m/one.png").write_bytes(b"no picture")
    outcome = batch(source, runs, resume=True, progress=said.append, **options)
    assert said[0].news.startswith("1 of 2 photos lack a file") and not said[0].running
    assert (
        "m/two.png for two.png" in said[0].news
        and outcome.count("failed") == 2
        and (runs / "two.scene").is_dir()
    )


def test_a_list_is_parsed_once_for_all_photos_and_anew_when_it_was_changed(recipe, monkeypatch):
    parsed = []
    real = read_recipe
    monkeypatch.setattr(
        "materialist.edits.recipe.read_recipe", lambda path: parsed.append(path) or real(path)
    )
    one, other = (edits_for(recipe, name)[0].options["mesh"] for name in "ab")
    assert len(parsed) == 1 and one == ["a.ply", "ball.ply"] and other == ["b.ply", "ball.ply"]
    recipe.write_text(TEXT.replace("20", "30"))
    assert edits_for(recipe, "a")[1].options["hue"] == "30"
