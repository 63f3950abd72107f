"""The way back: one for each change, and one for a whole drag of a slider."""

import numpy as np
import pytest
from studio_scenes import click

from materialist.errors import InputError
from materialist.io.exr import write_exr
from materialist.io.image import write_png_bytes
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
    for name in ("a.exr", "b.exr"):
        write_exr(session.workspace / name, np.ones((32, 64, 3), np.float32))
    for envmap in ("a.exr", "b.exr", "b.exr"):
        session.light(envmap=envmap, gain="auto")
    assert back(session) == before + 4  # the same again changes nothing
    session.undo()
    assert session.edits.steps[0].options["envmap"] == "a.exr"


def test_a_colour_is_dragged_and_a_texture_is_not(session):
    for name in ("a.png", "b.png"):
        write_png_bytes(session.workspace / name, np.full((8, 8, 3), 90, np.uint8))
    click(session)
    session.set("edit", hue="10")
    before = back(session)
    for colour in ("#101010", "#202020", "#303030"):
        session.set("edit", texture=None, albedo=colour)
    assert back(session) == before + 1
    for texture in ("a.png", "b.png"):
        session.set("edit", albedo=None, texture=texture)
    assert back(session) == before + 3 and "albedo" not in session.edits.steps[0].options
    session.undo()
    assert session.edits.steps[0].options["texture"] == "a.png"


def test_edits_that_were_changed_elsewhere_stay_and_so_does_the_way_back(session):
    click(session)
    session.set("edit", hue="10")
    stack, past = session.edits, session._past
    (session.workspace / "edits.yaml").write_text("- relight: {rotate: 20}\n")
    for act in (
        lambda: session.set("edit", hue="60"), session.undo, lambda: session.act("toggle", 0),
        lambda: session.light(rotate="5"),
    ):  # fmt: skip
        with pytest.raises(InputError, match="changed in another place"):
            act()
        assert session.edits == stack and session._past == past
    assert "rotate" in (session.workspace / "edits.yaml").read_text()
