"""Where things that fell lie: the end of the film, as one scene, and as a step of edits.yaml."""

from pathlib import Path

import numpy as np
import pytest
from made_meshes import box_file, extent, floor_scene

from materialist.edits.drop.drop import drop, settle
from materialist.edits.drop.physics import Pose
from materialist.edits.recipe import Step, apply, read_recipe, write_recipe
from materialist.errors import InputError

pytest.importorskip("mujoco")

UP = np.array([0, np.cos(np.radians(30)), np.sin(np.radians(30))])
AT = (48.0, 50.0)
FALL = "materialist.edits.drop.drop.fall"


@pytest.fixture(scope="module")
def box(tmp_path_factory) -> Path:
    return box_file(tmp_path_factory.mktemp("mesh") / "box.ply")


@pytest.fixture(scope="module")
def rested(box):
    return settle(floor_scene(96, 72), [box], AT, seed=3)


def test_it_is_the_end_of_the_film(box, rested):
    film = drop(floor_scene(96, 72), [box], AT, frames=72, seed=3)
    size = extent(rested.bodies)
    np.testing.assert_allclose(rested.bodies[0].vertices, film[-1].bodies[0].vertices, atol=0.01 * size)
    assert abs(float((rested.bodies[0].vertices @ UP + 2).min())) < 0.01 * size  # it lies on the floor
    assert not np.allclose(rested.bodies[0].vertices, film[0].bodies[0].vertices, atol=0.1 * size)
    assert rested.provenance["edits"] == film[-1].provenance["edits"]


def test_a_file_with_a_drop_says_the_same_before_and_after(tmp_path, box, rested):
    (tmp_path / "edits.yaml").write_text(f"- drop: {{mesh: {box}, at: [48, 50], seed: 3}}\n- relight: {{ambient: 2}}\n")
    scene, steps = floor_scene(96, 72), read_recipe(tmp_path / "edits.yaml")
    write_recipe(tmp_path / "again.yaml", steps)
    again = read_recipe(tmp_path / "again.yaml")
    assert again == steps
    for edited in (apply(scene, steps), apply(scene, again)):
        np.testing.assert_array_equal(edited.bodies[0].vertices, rested.bodies[0].vertices)
        assert [entry["kind"] for entry in edited.provenance["edits"]] == ["drop", "light"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"mesh": "box.ply"}, "needs its at"), ({"at": ["1", "2"]}, "needs its mesh"),
        ({"mesh": "none.ply", "at": ["1", "2"]}, "none.ply"), ({"mesh": ["a", ["b"]], "at": ["1", "2"]}, "file name"),
        ({"mesh": "box.ply", "at": ["48", "50"], "seed": "1.5"}, "seed"),
        ({"mesh": "box.ply", "at": ["48", "50"], "height": "-1"}, "height"),
        ({"mesh": "box.ply", "at": ["48", "50"], "gravity": ["0", "0", "0"]}, "gravity"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(box, options, words):
    with pytest.raises(InputError, match=words):
        apply(floor_scene(96, 72), [Step("drop", options, box.parent)])


def test_what_falls_out_of_the_scene_is_left_out(box, monkeypatch):
    scene = floor_scene(96, 72)
    below, still = Pose(np.array([0, 0, -1e6]), np.eye(3)), Pose(np.zeros(3), np.eye(3))
    monkeypatch.setattr(FALL, lambda *_, **__: [[below, still]] * 14)
    edited = settle(scene, [box, box], AT)
    assert len(edited.bodies) == 1 and any("left out" in note for note in edited.report.warnings)
    monkeypatch.setattr(FALL, lambda *_, **__: [[below]] * 14)
    with pytest.raises(InputError, match="falls beside everything"):
        settle(scene, [box], AT)


def test_what_lies_out_of_view_is_told(box, monkeypatch):
    away = Pose(np.array([0, 0, 2.0]), np.eye(3))
    monkeypatch.setattr(FALL, lambda *_, **__: [[away]] * 14)
    edited = settle(floor_scene(96, 72), [box], AT)
    assert edited.report.warnings == ("What fell came to rest where the camera does not look.",)


def test_what_rolls_on_is_told(box, monkeypatch):
    rolling = [[Pose(np.array([0.01 * k, 0, 0]), np.eye(3))] for k in range(40)]
    monkeypatch.setattr(FALL, lambda *_, **__: rolling)
    edited = settle(floor_scene(96, 72), [box], AT)
    assert any("at rest" in note for note in edited.report.warnings)
