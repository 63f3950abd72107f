"""The way back: one for each change, and one for a whole drag of a slider."""

import pytest
from studio_scenes import click

from materialist.errors import InputError
from materialist.studio import objects
from materialist.studio.objects import library_file
from materialist.studio.tab_light import place_lamp


def back(session) -> int:
    """How many changes can be taken back."""
    return len(session._past)


def test_each_change_of_light_is_taken_back_alone(session):
    before = back(session)
    for x in (10, 25, 40):
        place_lamp(session, x, 40)
    assert back(session) == before + 3
    session.undo()
    assert len(session.edits.steps[0].options["lamps"]) == 2
    for envmap in ("light-window.exr", "light-noon.exr", "light-noon.exr"):
        session.light(envmap=envmap, gain="auto")
    assert back(session) == before + 4  # the same again changes nothing
    session.undo()
    assert session.edits.steps[0].options["envmap"] == "light-window.exr"


def test_a_sun_is_switched_and_moved(session):
    before = back(session)
    session.light(sun=["45", "40"], sun_power="1")
    for azimuth in range(0, 90, 10):
        session.light(sun=[str(azimuth), "40"], sun_power="1")
    for power in ("1.2", "1.4"):
        session.light(sun=["80", "40"], sun_power=power)
    session.light(sun=None, sun_power=None)
    assert back(session) == before + 4 and session.edits.steps == ()
    for sun, power in ((["80", "40"], "1.4"), (["80", "40"], "1"), (["45", "40"], "1")):
        session.undo()
        assert (session.edits.steps[0].options["sun"], session.edits.steps[0].options["sun_power"]) == (sun, power)


def test_a_colour_is_dragged_and_a_texture_is_not(session):
    click(session)
    session.material(hue="10")
    before = back(session)
    for colour in ("#101010", "#202020", "#303030"):
        session.material(texture=None, albedo=colour)
    assert back(session) == before + 1
    for texture in ("a.png", "b.png"):
        session.material(albedo=None, texture=texture)
    assert back(session) == before + 3 and "albedo" not in session.edits.steps[0].options
    session.material(**dict.fromkeys(("albedo", "texture", "hue")))
    assert back(session) == before + 4
    session.undo()
    assert session.edits.steps[0].options["texture"] == "b.png"


def test_an_object_put_elsewhere_is_a_change_each_time(session):
    objects.set_option(session, "mesh", library_file(session, "Cube"))
    before = back(session)
    for x in (50, 15, 30):
        objects.place(session, x, 40)
    assert back(session) == before + 3
    for scale in ("0.5", "0.6"):
        objects.set_option(session, "scale", scale)
    for made_of in ("glass", "mirror", "#101010", "#202020", "#303030"):
        objects.set_option(session, "material", made_of)
    assert back(session) == before + 7
    session.undo()
    assert session.edits.steps[0].options["material"] == "mirror"


def test_edits_that_were_changed_elsewhere_stay_and_so_does_the_way_back(session):
    click(session)
    session.material(hue="10")
    stack, past = session.edits, session._past
    (session.workspace / "edits.yaml").write_text("- relight: {rotate: 20}\n")
    for act in (
        lambda: session.material(hue="60"), session.undo, lambda: session.act("toggle", 0),
        lambda: session.light(rotate="5"),
    ):  # fmt: skip
        with pytest.raises(InputError, match="changed in another place"):
            act()
        assert session.edits == stack and session._past == past
    assert "rotate" in (session.workspace / "edits.yaml").read_text()
