"""What the live preview shades."""

from pathlib import Path

import numpy as np
from edit_scenes import balls
from made_meshes import box_file

from materialist.edits.material.material import edit
from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio import drawn
from materialist.studio.live import preview
from materialist.studio.workspace import write_mask


def test_metal_with_normals_of_its_outline_is_shaded_with_all_other_steps(tmp_path, monkeypatch):
    """An inserted lamp would be no light."""

    def build(*_):
        raise InputError("Nothing is shaded here.")

    monkeypatch.setattr(preview, "_build", build)
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    live = preview.LivePreview(scene)
    mask = write_mask(tmp_path, number == 0)
    metal = Step("edit", {"mask": mask, "metallic": "1"}, tmp_path)
    box = str(box_file(tmp_path / "box.ply"))
    lamp = Step("insert", {"mesh": box, "at": ["70", "60"], "emission": "2"}, tmp_path)
    edited = live.edited((metal, lamp))
    assert edited.geometry is not scene.geometry and edited.bodies
    assert live._surfaces((metal, lamp)) is edited


def test_what_the_page_shades_of_metal_is_what_is_shaded_here(tmp_path):
    """Before the edit is metal the page asks for the tables of its outline, as it moves the slider."""
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    ball = number == 0
    live = preview.LivePreview(scene)
    live.prepared.wait(60)
    metal = Step("edit", {"mask": write_mask(tmp_path, ball), "metallic": "1"}, tmp_path)
    before = live.rows((), ball)["specular"]
    asked = live.rows((), ball, metal=ball)["specular"]
    np.testing.assert_array_equal(asked, live.rows((metal,), ball)["specular"])
    assert (asked != before).any()


def asked_for(scene, ball, **options):
    """Whether the page draws an edit of a ball with the normals of metal."""
    own = Step("edit", {name: str(value) for name, value in options.items()}, Path())
    return drawn.has_metal_normals(scene, own, ball)


def test_the_page_asks_anew_where_an_edit_becomes_metal():
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    ball = number == 0
    metallic = [0.2, 0.4, 0.6, 1, "+0.9", "+0.1"]
    asked = [asked_for(scene, ball, metallic=value) for value in metallic]
    assert asked == [False, False, True, True, True, False]
    assert not asked_for(scene, ball, roughness=0.1)
    assert not asked_for(scene, ball, metallic=1, normals="maps")


def test_a_soft_border_does_not_decide_what_is_metal():
    scene, number = balls(((-0.3, -0.2, -3), 0.4))
    ball = number == 0
    options = {"metallic": 0.6, "feather": 0.2}
    edited = edit(scene, ball, **options)
    assert asked_for(scene, ball, **options) and (edited.normal != scene.normal).any()
