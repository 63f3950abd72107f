"""A batch's list of edits for one photo of it: names put in, and a key that knows the files behind them."""

import numpy as np
import pytest

from materialist.batch.edits import edits_for, edits_key
from materialist.batch.run import batch
from materialist.io.package import load_scene

TEXT = "- drop: {mesh: ['{name}.ply', ball.ply], at: [3, 4]}\n- edit: {mask: 'm/{name}.png', hue: 20}\n"


@pytest.fixture
def recipe(tmp_path):
    for name in ("a.ply", "b.ply", "ball.ply"):
        (tmp_path / name).write_text(name)
    (tmp_path / "edits.yaml").write_text(TEXT)
    return tmp_path / "edits.yaml"


def test_the_name_is_put_into_every_file_of_a_list(recipe):
    drop, edit = edits_for(recipe, "a")
    assert drop.options["mesh"] == ["a.ply", "ball.ply"] and edit.options["mask"] == "m/a.png"
    assert drop.options["at"] == ["3", "4"]


def test_the_key_changes_with_a_mesh_and_with_nothing_else(recipe):
    key = edits_key(recipe, "a", 8)
    assert edits_key(recipe, "a", 8) == key and edits_key(recipe, "b", 8) != key and edits_key(recipe, "a", 9) != key
    (recipe.parent / "b.ply").write_text("of another photo")
    assert edits_key(recipe, "a", 8) == key
    (recipe.parent / "ball.ply").write_text("another ball")
    assert edits_key(recipe, "a", 8) != key


def test_a_drop_is_applied_to_every_photo(tmp_path):
    pytest.importorskip("mujoco")
    pytest.importorskip("mitsuba")
    from made_batch import photos
    from made_meshes import box_file

    box_file(tmp_path / "box.ply")
    (tmp_path / "edits.yaml").write_text(
        "- drop: {mesh: box.ply, at: [12, 8], scale: 3, height: 0.2, gravity: [0, 0, -1]}\n"
    )
    photos(tmp_path / "photos", "one")
    runs = tmp_path / "runs"
    outcome = batch(
        tmp_path / "photos", runs, apply=tmp_path / "edits.yaml", spp=4, function="made_batch:made_up",
        workers=1, device="cpu", size=24, seed=1,
    )  # fmt: skip
    (row,) = outcome.rows
    assert row["status"] == "done", row["reason"]
    from PIL import Image

    before, after = (np.asarray(Image.open(f)).astype(int) for f in (tmp_path / "photos/one.png", runs / "one.png"))
    assert (np.abs(after - before).max(-1) > 8).any() and load_scene(runs / "one.scene").bodies == ()
