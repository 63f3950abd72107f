"""The way back: one for each change, and one for a whole drag of a slider."""

import pytest
from studio_scenes import click

from materialist.errors import InputError
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
