"""A page's session, on a small scene with a real preview."""

from dataclasses import replace

import numpy as np
import pytest
from live_here import LiveHere
from made_meshes import floor_scene
from studio_scenes import block, click, room

from materialist.edits.recipe import Step, apply, read_recipe
from materialist.errors import InputError, OutputError
from materialist.io.exr import write_exr
from materialist.io.image import write_png
from materialist.io.package import save_scene
from materialist.studio import SETTINGS, objects
from materialist.studio.edit_list import EditList, step_summary
from materialist.studio.finals import keep_final, kept_final, new_final
from materialist.studio.history import read_history
from materialist.studio.lights import place_lamp
from materialist.studio.reporting import named_maps, quality
from materialist.studio.selection import Selection
from materialist.studio.session import Session
from materialist.studio.stage import commands, stage


def test_an_edit_from_click_to_recipe(session):
    with pytest.raises(InputError, match="Click the object"):
        session.set("edit", hue="30")
    click(session)
    session.set("edit", hue="120")
    session.set("edit", roughness="0.2")
    steps = read_recipe(session.workspace / "edits.yaml")
    assert len(steps) == 1 and steps[0].options == {
        "mask": steps[0].options["mask"],
        "hue": "120",
        "roughness": "0.2",
    }
    edited = apply(room(), steps)
    changed = (edited.materials.albedo != room().materials.albedo).any(-1)
    assert changed[block()].mean() > 0.9 and not changed[~block()].any()
    session.set("edit", hue=None)
    session.set("edit", roughness=None)
    assert (
        apply(room(), read_recipe(session.workspace / "edits.yaml")).materials.roughness.min()
        == 0.5
    )


def test_a_slider_without_a_number_writes_nothing(session):
    click(session)
    session.set("edit", hue="120")
    session.act("toggle", 0)  # what is switched off is not applied, so nobody else would notice
    session.act("choose", 0)
    with pytest.raises(InputError, match="no finite number"):
        place_lamp(session, 25, 24, float("inf"))
    with pytest.raises(InputError, match="hue"):
        session.set("edit", hue="nan")
    assert "nan" not in (session.workspace / "edits.yaml").read_text() and not session.next_object


def test_undo_takes_a_whole_drag_back_and_choices_one_by_one(session):
    for name in ("a.png", "b.png"):
        write_png(session.workspace / name, np.full((8, 8, 3), 90, np.uint8))
    for name in ("a.exr", "b.exr"):
        write_exr(session.workspace / name, np.ones((32, 64, 3), np.float32))
    click(session)
    for colour in ("#101010", "#202020", "#303030"):
        session.set("edit", texture=None, albedo=colour)
    for texture in ("a.png", "b.png"):
        session.set("edit", albedo=None, texture=texture)
    for left in ({"texture": "a.png"}, {"albedo": "#303030"}):
        session.undo()
        (step,) = session.edits.steps
        assert {
            name: step.options[name] for name in ("texture", "albedo") if name in step.options
        } == left
    session.undo()
    assert session.edits.steps == () and not (session.workspace / "edits.yaml").exists()
    for envmap in ("a.exr", "b.exr", "b.exr"):  # the same again changes nothing
        session.light(envmap=envmap, gain="auto")
    for x in (10, 25):
        place_lamp(session, x, 40)
    session.undo()
    assert len(session.edits.steps[0].options["lamps"]) == 1
    session.undo()
    session.undo()
    assert session.edits.steps[0].options["envmap"] == "a.exr"
    session.undo(again=True)
    session.undo(again=True)
    assert (
        session.edits.steps[0].options["envmap"] == "b.exr"
        and len(session.edits.steps[0].options["lamps"]) == 1
    )
    session.undo()
    session.light(ambient="0.5")
    with pytest.raises(InputError, match="nothing to do again"):
        session.undo(again=True)


def test_a_selection_that_grows_takes_its_edit_along(session):
    click(session)
    session.set("edit", hue="90")
    first = session.edits.steps[0].options["mask"]
    click(session, 50, 40, "add")
    assert session.edits.current == 0 and session.edits.steps[0].options["mask"] != first
    click(session, 25, 24, "new")  # inside the mask: taken away, so nothing of it is current
    click(session, 25, 24, "new")
    session.set("edit", value="0.5")
    assert len(session.edits.steps) == 2


def test_a_light_that_is_switched_off_is_not_gone_on_with(session):
    place_lamp(session, 40, 40)
    session.act("toggle", 0)
    assert stage(session)["lamps"] == []
    place_lamp(session, 10, 40)
    assert [step.skipped for step in session.edits.steps] == [True, False]
    session.act("choose", 0)
    assert "the current edit is switched off" in stage(session)["badge"]


def test_choosing_a_step_brings_its_region_and_values_back(session):
    click(session)
    session.set("edit", hue="90")
    session.light(rotate="30", ambient="0.5", sun=["10", "20"])
    assert session.edits.current == 1 and len(session.edits.steps) == 2
    session.deselect()
    session.act("choose", 0)
    assert (session.selection.mask & block()).sum() > 0.9 * block().sum()
    assert session.edits.current == 0 and session.edits.light == 1
    session.act("up", 1)
    assert [s.kind for s in session.edits.steps] == ["relight", "edit"]
    with pytest.raises(InputError, match="no longer"):
        session.act("remove", 7)
    with pytest.raises(InputError, match="not known"):
        session.act("rm -rf", 0)


def test_reopened_where_it_was_left(session):
    """After a restart of the studio, too: nothing of it is in memory alone."""
    click(session)
    session.set("edit", hue="77")
    session.light(rotate="5")
    session.undo()
    picture = new_final(session.workspace, session.edits.active)
    for suffix in (".jpg", ".png", ".exr", "-before.jpg"):
        picture.path.with_name(picture.path.name + suffix).write_bytes(b"x")
    keep_final(session.workspace, picture)
    other = Session("me")
    other.open(session.project)
    assert other.edits == session.edits and other.final.of(other.edits.active)
    assert np.array_equal(other.selection.mask, session.selection.mask)
    assert "materialist apply" in commands(other) and "edits-me/edits.yaml" in commands(other)
    other.undo(again=True)
    assert other.edits.steps[1].options["rotate"] == "5"
    for count in (1, 0):
        other.undo()
        assert len(other.edits.steps) == count
    other.live.wait()
    stage(other)
    other.close()
    with pytest.raises(InputError, match="Open a photo"):
        other.set("edit", hue="1")
    session.take_over()


def test_of_two_final_pictures_the_last_is_kept(session):
    for hue in ("3", "4"):
        picture = new_final(session.workspace, (Step("edit", {"hue": hue}, session.workspace),))
        picture.path.with_suffix(".jpg").write_bytes(hue.encode())
        keep_final(session.workspace, picture)
    assert kept_final(session.workspace) == picture
    assert [file.read_text() for file in session.workspace.glob("final-*.jpg")] == ["4"]
    (session.workspace / "final.json").write_text('{"name": "../../x", "steps": [["edit", {}]]}')
    assert kept_final(session.workspace) is None


@pytest.mark.parametrize("damage", ["{", "[]", '{"past": [["", [7], null, []]]}', "mask"])
def test_a_history_that_cannot_be_read_begins_anew(session, damage):
    click(session)
    session.set("edit", hue="10")
    if damage == "mask":
        for file in session.workspace.glob("mask-*.png"):
            write_png(file, np.zeros((5, 5, 3), np.uint8))
    else:
        (session.workspace / "history.json").write_text(damage)
    history = read_history(session.workspace, session.scene.depth.shape)
    assert history.past == [] and history.selection == Selection()
    for file in session.workspace.glob("mask-*.png"):
        file.unlink()


def test_a_selection_that_its_edit_follows_is_kept_for_the_next_start(session, monkeypatch):
    click(session)
    session.set("edit", hue="10")
    before = session.selection.mask
    grown = before.copy()
    grown[:, :20] = True
    monkeypatch.setattr(session.live, "select", lambda click, extent, sharpen=True: grown.copy())
    session.reselect(lambda selection: selection.resized(True, session.preview.select))
    history = read_history(session.workspace, session.scene.depth.shape)
    np.testing.assert_array_equal(history.selection.mask, grown)
    session.undo()
    np.testing.assert_array_equal(session.selection.mask, before)


def test_a_change_that_cannot_be_written_is_none(session, monkeypatch):
    """On a full disk the page shows what is kept, not what was refused."""
    click(session)
    session.set("edit", hue="10")
    before = session.edits

    def full(path, steps):
        raise OutputError("The disk is full.")

    monkeypatch.setattr("materialist.studio.session.write_recipe", full)
    for change in (lambda: session.set("edit", hue="20"), lambda: session.act("toggle", 0)):
        with pytest.raises(OutputError, match="full"):
            change()
        assert session.edits == before
    monkeypatch.undo()
    session.undo()
    assert session.edits.steps == ()


def test_edits_that_cannot_be_read_are_left_as_they_are(studio, session):
    """What somebody wrote by hand must not vanish with the next button."""
    click(session)
    session.set("edit", roughness="0.2")
    file = session.workspace / "edits.yaml"
    project = session.project
    text = file.read_text().replace("0.2", "0.2\n    texture: ../wood.png")
    file.write_text(text)
    other = Session("me")
    with pytest.raises(InputError, match=r"left as they are.*wood.*edits\.yaml"):
        other.open(project)
    assert other.project is None and other.live is None
    other.save()
    assert not other.edits.active and file.read_text() == text
    file.unlink()


def test_edits_that_were_changed_elsewhere_are_taken_over(session):
    """By another studio on the same folder, or by hand: neither list is lost."""
    for act in (
        lambda: session.set("edit", hue="60"),
        session.undo,
        lambda: session.act("toggle", 0),
        lambda: session.light(rotate="5"),
    ):
        session.deselect()
        click(session)
        session.set("edit", hue="10")
        own = session.edits.steps
        (session.workspace / "edits.yaml").write_text("- relight: {rotate: 20}\n")
        with pytest.raises(InputError, match="changed in another place meanwhile; here they are"):
            act()
        assert session.edits.steps[0].options == {"rotate": "20"}
        session.undo()
        assert session.edits.steps == own
        session.act("remove", 0)


@pytest.mark.parametrize("where", ["box: [12, 12, 40, 36]", "click: [25, 24], with: grabcut"])
def test_an_edit_by_click_or_box_grows_by_a_mask(session, tmp_path, where):
    (tmp_path / "edits.yaml").write_text(f"- edit: {{{where}, hue: 50}}")
    session.read_edits(tmp_path / "edits.yaml")
    session.act("choose", 0)
    assert (session.selection.mask & block()).sum() > 0.8 * block().sum()
    click(session, 50, 40, "add")
    (step,) = read_recipe(session.workspace / "edits.yaml")
    assert set(step.options) == {"mask", "hue"}
    changed = (apply(room(), [step]).materials.albedo != room().materials.albedo).any(-1)
    assert np.array_equal(changed, session.selection.mask) and changed[40, 50]


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ("edit: {click: [25, 24], box: [1, 1, 9, 9], hue: 5}", "exactly one"),
        ("relight: {rotate: abc}", "rotate"),
        ("relight: {lamps: [[a, b, 1, 2700, 1]]}", "lamp"),
        ("insert: {mesh: thing-cube.ply}", "at"),
    ],
)
def test_a_list_that_cannot_be_applied_is_shown_and_can_be_mended(session, bad, words):
    (session.workspace / "thing-cube.ply").touch()
    (session.workspace / "edits.yaml").write_text(
        f"- edit: {{click: [25, 24], hue: 50}}\n- {bad}\n"
    )
    other = Session("me")
    other.open(session.project)
    other.live.wait()
    shown = stage(other)
    assert len(other.edits.steps) == 2 and shown["picture"] and shown["bad"]
    assert words in shown["badge"] and step_summary(other.edits.steps[1]) in shown["badge"]
    other.act("remove", 1)
    assert stage(other)["badge"] == "Live preview" and not stage(other)["bad"]
    other.close()
    (session.workspace / "thing-cube.ply").unlink()


def test_ticking_and_moving_leave_the_current_one():
    steps = tuple(Step(kind, {}) for kind in ("edit", "relight", "glass"))
    edits = EditList(steps, 2)
    assert edits.toggled(0).current == 2 and edits.toggled(0).toggled(0).current == 2
    assert edits.toggled(2).current is None and edits.toggled(2).toggled(2).current is None
    assert (
        edits.moved(0, 1).current == 2
        and edits.moved(1, 1).current == 1
        and edits.moved(2, -1).current == 1
    )
    assert (
        EditList(steps).moved(0, 1).current is None and EditList(steps).toggled(1).current is None
    )


@pytest.mark.slow
def test_an_object_falls_and_lies_there(session, monkeypatch, tmp_path):
    pytest.importorskip("mujoco", reason="needs the physics extra")
    save_scene(floor_scene(64, 48), tmp_path / "floor.scene")
    floor = LiveHere(tmp_path / "floor.scene", tmp_path / "floor.npz")
    monkeypatch.setattr(session, "live", floor)
    with pytest.raises(InputError, match="Place an object first"):
        objects.let_fall(session, 1.0)
    objects.set_object_option(session, "mesh", objects.library_file(session, "Cube"))
    objects.set_object_option(session, "scale", "0.5")
    objects.place(session, 32, 34)
    stands = session.live.here.edited(session.edits.active).bodies[0]
    assert objects.let_fall(session, 0.5) == []
    step = session.edits.steps[0]
    assert [s.kind for s in session.edits.steps] == ["drop"] and session.current_kind == "drop"
    assert (
        step.options["at"] == ["32", "34"]
        and step.options["scale"] == "0.5"
        and step.options["seed"] == "0"
    )
    lies = session.live.here.edited(session.edits.active).bodies[0]
    assert (
        lies.vertices.shape == stands.vertices.shape
        and np.abs(lies.vertices - stands.vertices).max() > 0.01
    )
    replayed = apply(floor.scene, read_recipe(session.workspace / "edits.yaml")).bodies[0]
    np.testing.assert_allclose(replayed.vertices, lies.vertices, atol=1e-6)
    objects.let_fall(session, 0.5)
    assert session.edits.steps[0].options["seed"] == "1" and len(session.edits.steps) == 1
    again = session.live.here.edited(session.edits.active).bodies[0]
    assert np.abs(again.vertices - lies.vertices).max() > 1e-3
    session.undo()
    session.undo()
    assert [s.kind for s in session.edits.steps] == ["insert"]


def test_the_report_is_plain_and_harmless():
    scene = replace(room(), report=replace(room().report, warnings=("<img src=x> [a](b)",)))
    text = quality(scene)
    assert (
        "31.5 dB from the photo" in text and "40.0°" in text and "&lt;img src=x> &#91;a](b)" in text
    )
    assert (
        all(p.dtype == np.uint8 and p.ndim == 3 for p, _ in named_maps(room()))
        and len(named_maps(room())) == 8
    )


def test_places_are_pixels_and_those_outside_are_refused(session):
    click(session, 64, 47.9)  # the page clips to the edge
    objects.set_object_option(session, "mesh", objects.library_file(session, "Cube"))
    objects.place(session, 64, 47.6)
    assert session.edits.steps[-1].options["at"] == ["63", "47"]
    place_lamp(session, 40.7, 40.7)
    assert session.edits.steps[-1].options["lamps"][0][:2] == ["40", "40"]
    for change in (click, objects.place, place_lamp):
        with pytest.raises(InputError, match="outside of the photo"):
            change(session, 99999, 20)


def test_sixty_steps_can_be_taken_back(session):
    for _ in range(70):
        session.deselect()
    assert len(session._past) == SETTINGS.undo_steps


def test_a_shape_that_was_not_written_to_its_end_is_not_there(session, monkeypatch):
    def broken(mesh, file):
        file.write_bytes(b"ply")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("trimesh.Trimesh.export", broken)
    with pytest.raises(OutputError, match="no space left"):
        objects.library_file(session, "Cone")
    assert not [*session.workspace.glob("*cone*")]
