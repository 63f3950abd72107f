"""The list of edits."""

from materialist.edits.recipe import Step
from materialist.studio.edit_list import EditList

A, B, C = (
    Step("edit", {"mask": "mask-1.png", "hue": "20"}),
    Step("relight", {"rotate": "90"}),
    Step("edit", {"hue": "1"}),
)


def test_add_move_toggle_remove():
    edits = EditList().add(A).add(B).add(C)
    assert edits.current == 2 and edits.steps == (A, B, C)
    assert edits.moved(2, -1).steps == (A, C, B) and edits.moved(2, -1).current == 1
    assert edits.moved(0, -1) is edits and edits.moved(2, 1) is edits
    off = edits.toggled(1)
    assert off.active == (A, C) and off.steps[1].skipped and off.toggled(1).steps == edits.steps
    assert edits.without(0).steps == (B, C) and edits.without(0).current is None
    assert edits.current_step == C and edits.without(0).current is None


def test_ticking_and_moving_leave_the_current_one():
    edits = EditList((A, B, C), 2)
    assert edits.toggled(0).current == 2 and edits.toggled(0).toggled(0).current == 2
    assert edits.toggled(2).current is None and edits.toggled(2).toggled(2).current is None
    assert edits.moved(0, 1).current == 2 and edits.moved(1, 1).current == 1 and edits.moved(2, -1).current == 1
    assert EditList((A, B, C)).moved(0, 1).current is None and EditList((A, B, C)).toggled(1).current is None
