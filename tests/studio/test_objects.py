"""What falls, on a small scene with a real preview."""

import numpy as np
import pytest
from made_meshes import floor_scene

from materialist.edits.recipe import apply, read_recipe
from materialist.errors import InputError
from materialist.studio import objects
from materialist.studio.objects import library_file
from materialist.studio.preview import LivePreview


def test_an_object_falls_and_lies_there(session, monkeypatch):
    pytest.importorskip("mujoco", reason="needs the physics extra")
    floor = LivePreview(floor_scene(64, 48))
    monkeypatch.setattr(session, "live", floor)
    with pytest.raises(InputError, match="Place an object first"):
        objects.let_fall(session, 1.0)
    objects.set_option(session, "mesh", library_file(session, "Cube"))
    objects.set_option(session, "scale", "0.5")
    objects.place(session, 32, 34)
    stands = session.live.edited(session.edits.active).bodies[0]
    assert objects.let_fall(session, 0.5) == []
    step = session.edits.steps[0]
    assert [s.kind for s in session.edits.steps] == ["drop"] and session.current_kind == "drop"
    assert step.options["at"] == ["32", "34"] and step.options["scale"] == "0.5" and step.options["seed"] == "0"
    lies = session.live.edited(session.edits.active).bodies[0]
    assert lies.vertices.shape == stands.vertices.shape and np.abs(lies.vertices - stands.vertices).max() > 0.01
    replayed = apply(floor.scene, read_recipe(session.workspace / "edits.yaml")).bodies[0]
    np.testing.assert_allclose(replayed.vertices, lies.vertices, atol=1e-6)
    objects.let_fall(session, 0.5)
    assert session.edits.steps[0].options["seed"] == "1" and len(session.edits.steps) == 1
    again = session.live.edited(session.edits.active).bodies[0]
    assert np.abs(again.vertices - lies.vertices).max() > 1e-3
    session.undo()
    session.undo()
    assert [s.kind for s in session.edits.steps] == ["insert"]
    floor.close()
