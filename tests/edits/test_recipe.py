"""Lists of edits: what they mean, and what is wrong with them."""

import numpy as np
import pytest
from edit_scenes import MASK, flat_scene
from made_meshes import box_file
from PIL import Image

from materialist.edits import recipe
from materialist.edits.light.relight import lamp, relight
from materialist.edits.material.material import edit
from materialist.edits.recipe import Step, apply, read_recipe, write_recipe
from materialist.errors import InputError, OutputError
from materialist.io.exr import write_exr

pytestmark = pytest.mark.usefixtures("filled_smoothly")

SCENE = flat_scene()


@pytest.fixture
def folder(tmp_path):
    Image.fromarray((MASK * 255).astype(np.uint8)).save(tmp_path / "block.png")
    write_exr(tmp_path / "sky.exr", np.full((16, 32, 3), 2.0, np.float32))
    return tmp_path


def replay(folder, text):
    (folder / "edits.yaml").write_text(text)
    return apply(SCENE, read_recipe(folder / "edits.yaml"))


def test_steps_are_the_functions_in_order(folder):
    got = replay(
        folder,
        "edits:\n- edit: {mask: block.png, hue: 120, roughness: +0.25}\n- edit: {mask: block.png, metallic: 0.5}\n"
        "- relight: {envmap: sky.exr, gain: 0.5, rotate: 45, ambient: 0.5,\n"
        "            lamps: [[5, 6, 2, 3000, 1], [9, 9, 2, 4000, 2]]}\n",
    )
    expected = edit(edit(SCENE, MASK, hue=120, roughness="+0.25"), MASK, metallic=0.5)
    lamps = [lamp(SCENE, 5, 6, 2, 3000, 1), lamp(SCENE, 9, 9, 2, 4000, 2)]
    expected = relight(
        expected, envmap=np.full((16, 32, 3), 2.0), gain=0.5, rotate=45, ambient=0.5, lamps=lamps
    )
    for name in ("albedo", "roughness", "metallic"):
        np.testing.assert_array_equal(
            getattr(got.materials, name), getattr(expected.materials, name)
        )
    np.testing.assert_array_equal(got.envmap, expected.envmap)
    assert got.lamps == expected.lamps and len(got.provenance["edits"]) == 3


def test_a_list_may_be_utf16_and_no_other_encoding_than_that_and_utf8(folder, real_data):
    (folder / "latin.yaml").write_bytes("# grün\n- relight: {rotate: 45}\n".encode("latin-1"))
    with pytest.raises(InputError, match="save it as UTF-8"):
        read_recipe(folder / "latin.yaml")
    text = "# grün\n- relight: {rotate: 45}\n"
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        (folder / "edits.yaml").write_text(text, encoding)
        assert [step.kind for step in read_recipe(folder / "edits.yaml")] == ["relight"]
    (step,) = read_recipe(real_data("data/reported/edits_utf16/u16.yaml"))
    assert step.kind == "edit" and step.options["click"] == ["50", "30"]


def test_an_insert_may_have_several_places(folder):
    box_file(folder / "box.ply", (0.1, 0.1, 0.1))
    for places in ("[[8, 30], [40, 30]]", "['8,30', '40,30']"):
        bodies = replay(folder, f"- insert: {{mesh: box.ply, at: {places}}}").bodies
        assert len(bodies) == 2 and bodies[0].vertices[:, 0].max() < bodies[1].vertices[:, 0].min()
    assert len(replay(folder, "- insert: {mesh: box.ply, at: '8,30'}").bodies) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no list of edits"),
        ("edits: []", "no list of edits"),
        ("- [", "not valid YAML"),
        ("- paint: {}", "is 'paint'; it must be one of edit,"),
        ("- edit: {mask: block.png, hue: 1}\n- edit: {colour: red}", "Step 2"),
        ("- relight: now", "no options"),
        ("- edit: {mask: block.png, hue: 3, hue: 90}", "'hue' is given twice"),
        ("edits: [{edit: {mask: block.png, hue: 3}}]\nlights: 3", "says 'lights' beside its edits"),
        (
            "- edit: {mask: block.png, hue: 3, skip: ture}",
            "The skip must be true or false, not 'ture'",
        ),
        ("- relight: {}", "changes nothing"),
        ("- edit: &a {hue: 3}\n- edit: *a", "an alias (*)"),
        ("[" * 3000, "nested too deeply"),
        ("#" * 1_000_001, "larger than 1 MB"),
    ],
)
def test_what_is_wrong_is_named(folder, text, words):
    with pytest.raises(InputError) as error:
        replay(folder, text)
    assert words in str(error.value)


@pytest.mark.parametrize(
    "second",
    [
        "edit: {mask: block.png, hue: 90}",
        "remove: {mask: block.png}",
        "glass: {mask: block.png, model: two-interface}",
    ],
)
def test_what_was_taken_away_is_in_no_later_region(folder, second):
    with pytest.raises(InputError, match=r"Step 2 .*took away what is there"):
        replay(folder, f"- remove: {{mask: block.png}}\n- {second}\n")
    wide = np.zeros(MASK.shape, bool)
    rows = np.nonzero(MASK)[0]
    wide[rows.min() :, :] = True
    Image.fromarray((wide * 255).astype(np.uint8)).save(folder / "wide.png")
    removed = replay(folder, "- remove: {mask: block.png}\n")
    blue = "- edit: {mask: wide.png, albedo: [0, 0, 1], detail: 0}\n"
    got = replay(folder, "- remove: {mask: block.png}\n" + blue)
    gone = removed.depth != SCENE.depth
    assert gone.any() and np.array_equal(got.materials.albedo[gone], removed.materials.albedo[gone])
    assert np.allclose(got.materials.albedo[wide & ~gone], [0, 0, 1])


def test_a_region_says_its_material_and_what_is_not_of_it(folder, monkeypatch):
    seen = []

    def chosen(scene, **where):
        seen.append((where["same_material"], where.get("exclude")))
        return MASK

    monkeypatch.setattr(recipe, "select", chosen)
    region = 'click: "16,18", same_material: true, exclude: ["20,21", [22, 23]]'
    replay(folder, f"- edit: {{{region}, hue: 10}}\n")
    replay(folder, '- edit: {click: "16,18", exclude: "20,21", hue: 10}\n')
    assert seen == [(True, [(20, 21), (22, 23)]), (False, [(20, 21)])]
    with pytest.raises(InputError, match="same_material must be true or false, not 'cloth'"):
        replay(folder, '- edit: {click: "16,18", same_material: cloth, hue: 10}\n')


def test_a_region_is_chosen_on_the_steps_device(monkeypatch):
    seen = []
    monkeypatch.setattr(recipe, "select", lambda scene, device, **_: seen.append(device) or MASK)
    apply(
        SCENE, [recipe.Step("edit", {"click": [16, 18], "with": "sam2", "hue": 10})], device="cpu"
    )
    assert seen == ["cpu"]


def test_a_list_that_could_not_be_read_again_is_not_written(folder, monkeypatch):
    monkeypatch.setattr(recipe, "MAX_BYTES", 1000)
    long, longer = (Step("edit", {"albedo": "x" * count}) for count in (900, 1000))
    write_recipe(folder / "edits.yaml", [long])
    with pytest.raises(OutputError, match=r"edits\.yaml would have"):
        write_recipe(folder / "edits.yaml", [longer])
    assert read_recipe(folder / "edits.yaml")[0].options == long.options
