"""Edits whose region is a click or a box, and lists that cannot be applied."""

import numpy as np
import pytest
from studio_scenes import block, click, named, room

from materialist.edits.recipe import apply, read_recipe
from materialist.studio.session import Session
from materialist.studio.stage import stage


def loaded(session, folder, text):
    """The session with a list of edits from a file."""
    file = folder / "edits.yaml"
    file.write_text(text)
    session.read_edits(file)
    return session


@pytest.mark.parametrize("where", ["box: [12, 12, 40, 36]", "click: [25, 24], with: grabcut"])
def test_an_edit_by_click_or_box_grows_by_a_mask(session, tmp_path, where):
    loaded(session, tmp_path, f"- edit: {{{where}, hue: 50}}")
    session.act("choose", 0)
    assert (session.selection.mask & block()).sum() > 0.8 * block().sum()
    click(session, 50, 40, "add")
    (step,) = read_recipe(session.workspace / "edits.yaml")
    assert set(step.options) == {"mask", "hue"}
    changed = (apply(room(), [step]).materials.albedo != room().materials.albedo).any(-1)
    assert np.array_equal(changed, session.selection.mask) and changed[40, 50]


@pytest.mark.parametrize(
    ("bad", "words"),
    [("edit: {click: [25, 24], box: [1, 1, 9, 9], hue: 5}", "exactly one"), ("relight: {rotate: abc}", "rotate"),
     ("relight: {lamps: [[a, b, 1, 2700, 1]]}", "lamp"), ("insert: {mesh: thing-cube.ply}", "at")],
)  # fmt: skip
def test_a_list_that_cannot_be_applied_is_shown_and_can_be_mended(session, bad, words):
    (session.workspace / "thing-cube.ply").touch()
    (session.workspace / "edits.yaml").write_text(f"- edit: {{click: [25, 24], hue: 50}}\n- {bad}\n")
    other = Session("me")
    other.open(session.project)
    other.live.wait()
    shown = named().everything(other)
    assert len(shown["steps"]) == 2 and shown["stage"]["picture"] and shown["stage"]["bad"]
    assert words in shown["stage"]["badge"] and shown["steps"][1]["text"] in shown["stage"]["badge"]
    other.act("remove", 1)
    assert stage(other)["badge"] == "Live preview" and not stage(other)["bad"]
    other.close()
    (session.workspace / "thing-cube.ply").unlink()
