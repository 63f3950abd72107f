"""What a page shows."""

import pytest

from materialist.edits.recipe import Step
from materialist.studio.edit_list import EditList
from materialist.studio.stage import stage


@pytest.mark.parametrize("x", ["nan", "inf", "1e999"])
def test_a_lamp_without_a_place_has_no_mark(session, x):
    """A list by hand may hold one, switched off: JSON has no such number."""
    lamps = [[x, "3", "1", "2700", "1"], ["4", "3", "1", "2700", "1"]]
    session.edits = EditList((Step("relight", {"skip": "true", "lamps": lamps}),), 0)
    assert stage(session)["lamps"] == [[4.0, 3.0]]
