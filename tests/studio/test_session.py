"""A page's session, on a small scene with a real preview."""

import subprocess
from types import SimpleNamespace

import numpy as np
import pytest
from studio_scenes import block, click, room

from materialist.edits.recipe import Step, apply, read_recipe
from materialist.errors import InputError
from materialist.studio.edit_list import EditList
from materialist.studio.selection import Selection
from materialist.studio.session import Session
from materialist.studio.stage import stage
from materialist.studio.tab_light import place_lamp
from materialist.studio.widgets import commands, light_values, material_values
from materialist.studio.workspace import Project


def test_an_edit_from_click_to_recipe(session):
    with pytest.raises(InputError, match="Click the object"):
        session.material(hue="30")
    click(session)
    session.material(hue="120")
    session.material(roughness="0.2")
    steps = read_recipe(session.workspace / "edits.yaml")
    assert len(steps) == 1 and steps[0].options == {"mask": steps[0].options["mask"], "hue": "120", "roughness": "0.2"}
    edited = apply(room(), steps)
    changed = (edited.materials.albedo != room().materials.albedo).any(-1)
    assert changed[block()].mean() > 0.9 and not changed[~block()].any()
    session.material(hue=None)
    session.material(roughness=None)
    assert apply(room(), read_recipe(session.workspace / "edits.yaml")).materials.roughness.min() == 0.5


def test_quick_pictures_agree_with_slow_ones(session):
    click(session)
    session.material(hue="120")
    session.material(metallic="1")
    edited = session.live.edited(session.edits.active)
    preview = session.live._preview.result()
    whole = preview._image(preview._shaded(edited.materials, preview._tables), preview._sky(edited.envmap))
    np.testing.assert_allclose(preview.render(edited), whole, atol=2e-6)
    quick, slow = preview.picture(edited, quick=True), preview.picture(edited)
    outside = ~session.selection.mask
    assert np.array_equal(quick[outside], room().photo.linear[outside])
    import cv2

    inner = cv2.erode(block().astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    np.testing.assert_allclose(quick[inner], slow[inner], atol=0.02)


def test_undo_takes_a_whole_drag_back(session):
    click(session)
    for hue in range(10, 100, 10):
        session.material(hue=str(hue))
    session.undo()
    assert session.edits.steps[0].options.get("hue") in (None, "10")
    while session.undo():
        pass
    assert session.edits.steps == () and not (session.workspace / "edits.yaml").exists()


def test_a_selection_that_grows_takes_its_edit_along(session):
    click(session)
    session.material(hue="90")
    first = session.edits.steps[0].options["mask"]
    click(session, 50, 40, "add")
    assert session.edits.current == 0 and session.edits.steps[0].options["mask"] != first
    click(session, 25, 24, "new")  # inside the mask: taken away, so nothing of it is left in hand
    click(session, 25, 24, "new")
    session.material(value="0.5")
    assert len(session.edits.steps) == 2


def test_a_light_that_is_switched_off_is_not_gone_on_with(session):
    place_lamp(session, 40, 40)
    session.act("toggle", 0)
    assert stage(session)["lamps"] == [] and not light_values(session)["sun_on"]
    session.light(rotate="30")
    place_lamp(session, 10, 40)
    assert [step.skipped for step in session.edits.steps] == [True, False]
    assert len(session.edits.steps[0].options["lamps"]) == len(session.edits.steps[1].options["lamps"]) == 1
    session.act("toggle", 1)
    session.act("toggle", 0)
    session.light(ambient="0.5")  # of the one that is on
    assert session.edits.steps[0].options["ambient"] == "0.5" and len(session.edits.steps) == 2
    session.act("choose", 1)
    assert session.edits.current == 1 and light_values(session)["rotate"] == 30
    assert "the edit in hand is switched off" in stage(session)["badge"]
    session.act("toggle", 1)
    assert session.edits.current == 1 and "off" not in stage(session)["badge"]


def test_choosing_a_step_brings_its_region_and_values_back(session):
    click(session)
    session.material(hue="90")
    session.light(rotate="30", ambient="0.5", sun=["10", "20"])
    assert session.edits.current == 1 and len(session.edits.steps) == 2
    session.deselect()
    session.act("choose", 0)
    assert (session.selection.mask & block()).sum() > 0.9 * block().sum()
    assert material_values(session)["hue"] == 90 and material_values(session)["roughness"] == 0.5
    values = light_values(session)
    assert (values["rotate"], values["ambient"], values["sun_on"], values["elevation"]) == (30, 0.5, True, 20)
    session.act("up", 1)
    assert [s.kind for s in session.edits.steps] == ["relight", "edit"]
    with pytest.raises(InputError, match="no longer"):
        session.act("remove", 7)
    with pytest.raises(InputError, match="not known"):
        session.act("rm -rf", 0)


def test_uploaded_recipes_stay_on_the_desk(session, tmp_path):
    secret = tmp_path / "secret.png"
    secret.write_bytes(b"x")
    for text, message in (
        (f"- edit: {{mask: {secret}, hue: 3}}", "plain file name"), ("- edit: {mask: ../x.png}", "plain file name"),
        ("- edit: {mask: nothere.png}", "not here"), ("- edit: {colour: red}", "says 'colour'"),
        ("- explode: {}", "must be one of"), ("!!python/object/apply:os.system ['true']", "must be one of"),
        ("- relight: {envmap: /etc/hostname}", "plain file name"),
    ):  # fmt: skip
        file = tmp_path / "edits.yaml"
        file.write_text(text)
        with pytest.raises(InputError, match=message):
            session.read_edits(file)
    assert session.edits.steps == ()
    file.write_text("- edit: {box: [12, 12, 40, 36], hue: 40}\n- relight: {rotate: 20, skip: true}\n")
    session.read_edits(file)
    assert len(session.edits.steps) == 2 and len(session.edits.active) == 1


def test_reopened_where_it_was_left(studio, session):
    click(session)
    session.material(hue="77")
    other = studio.session("another page", "me")
    studio.open(other, studio.start.name)
    assert other.edits.steps[0].options["hue"] == "77" and other.selection == Selection()
    assert "materialist apply" in commands(other) and "edits-me/edits.yaml" in commands(other)
    other.light(rotate="5")
    assert len(session.edits.steps) == 1  # in memory they are apart
    studio.leave("another page")
    assert other.live is None and session.live is not None
    with pytest.raises(InputError, match="Open a photo"):
        other.material(hue="1")


USUAL = {
    "predictor": "bundled step 9 sha256:01", "engine": "transport", "preset": "default", "size": 512, "tau": 6.0,
    "strategy": "default", "seed": 0, "fov": 35.0, "fov_source": "default",
}  # fmt: skip


@pytest.fixture
def typed(tmp_path):
    """What a shell calls `materialist` with when the page's commands are pasted, one list of words a call."""
    folder = tmp_path / "my photos" / "photo-001"
    (folder / "edits-me").mkdir(parents=True)

    def run(made, *, steps=(), there=True, photo=True):
        if there:
            (folder / "photo.scene").mkdir(exist_ok=True)
        project = Project(folder, "Jug", "me", folder / "photo.scene", folder / "original.jpg" if photo else None)
        page = SimpleNamespace(project=project, workspace=folder / "edits-me", edits=EditList(steps))
        page.scene = SimpleNamespace(provenance=made)
        program = 'materialist() { pwd -P; printf "%s\\n" "$@" .; }\nset -e\n'
        done = subprocess.run(["bash", "-c", program + commands(page)], capture_output=True, text=True, check=True)
        calls = [call.strip("\n").split("\n") for call in done.stdout.split("\n.\n") if call.strip()]
        assert all(call[0] == str(folder.resolve()) for call in calls)
        return [call[1:] for call in calls]

    return run


def test_edits_are_in_what_the_commands_export(typed):
    apply, export = typed(USUAL, steps=(Step("relight", {"rotate": "5"}),))
    assert apply[:3] == ["apply", "photo.scene", "edits-me/edits.yaml"] and apply[-2:] == ["--save", "edited.scene"]
    assert export[:2] == ["export", "edited.scene"]
    off = Step("relight", {"rotate": "5", "skip": "true"})
    assert typed(USUAL, steps=(off,))[1][:2] == ["export", "photo.scene"]


@pytest.mark.parametrize(
    ("made", "options"),
    [
        ({}, []),
        ({"predictor": "matnet vitb matnet.pth sha256:01"}, ["--predictor", "matnet"]),
        ({"predictor": "matnet", "size": 384}, ["--predictor", "matnet", "--size", "384"]),
        ({"fov": 61.25, "fov_source": "option", "seed": 3}, ["--fov", "61.25", "--seed", "3"]),
        ({"fov": 61.25, "fov_source": "exif"}, []),
    ],
)
def test_the_commands_have_the_options_of_the_inversion(typed, made, options):
    assert typed({**USUAL, **made}, there=False)[0] == ["invert", "original.jpg", "-o", "photo.scene", *options]


def test_edits_that_cannot_be_read_are_left_as_they_are(studio, session):
    """What somebody wrote by hand must not vanish with the next button."""
    click(session)
    session.material(roughness="0.2")
    file, project = session.workspace / "edits.yaml", session.project
    text = file.read_text().replace("0.2", "0.2\n    texture: ../wood.png")
    file.write_text(text)
    other = Session("me")
    with pytest.raises(InputError, match=r"left as they are.*wood.*edits\.yaml"):
        other.open(project)
    assert other.project is None and other.live is None
    other.save()
    assert not other.edits.active and file.read_text() == text
    file.unlink()


def test_another_page_s_edits_are_not_overwritten(session):
    click(session)
    session.material(roughness="0.2")
    other = Session("me")
    other.open(session.project)
    other.light(ambient="0.5")
    written = (session.workspace / "edits.yaml").read_bytes()
    with pytest.raises(InputError, match="changed in another place"):
        session.material(roughness="0.9")
    assert (session.workspace / "edits.yaml").read_bytes() == written
    other.close()
