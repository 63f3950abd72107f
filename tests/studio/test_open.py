"""Opening photos, without a page."""

from concurrent.futures import Future

import pytest
from studio_scenes import click, named

from materialist.jobs.queue import STOPPED, Job
from materialist.jobs.worker import FAILED
from materialist.studio import tasks
from materialist.studio.tab_open import _following, _opened


@pytest.mark.parametrize("end", [FAILED, STOPPED])
def test_a_photo_that_fails_leaves_the_open_one_known(studio, session, end):
    project = studio.work.new("Too dark", "me")
    job = Job("invert", "me", project.folder, tasks.invert, state=end)
    updates = list(_following(named(studio), session, project, job))
    assert updates[0]["last"] == project.name and updates[-1]["last"] == session.project.name
    assert not project.folder.exists()
    nothing = studio.session("an empty page", "me")
    project = studio.work.new("Too dark", "me")
    assert list(_following(named(studio), nothing, project, job))[-1]["last"] == ""
    studio.leave("an empty page")


def test_a_click_before_the_preview_is_ready_shows_at_once(studio, session, monkeypatch):
    click(session)
    session.set("edit", hue="90")
    steps = _opened(named(studio), session, session.project)
    next(steps)
    first = next(steps)
    assert len(first["steps"]) == 1 and first["stage"]["picture"] and "materialist apply" in first["commands"]
    with monkeypatch.context() as patch:
        patch.setattr(session.live, "_preview", Future())  # in the making
        click(session, 50, 40)
        shown = named(studio).everything(session)
    assert len(shown["steps"]) == 1 and shown["stage"]["fill"] and "picture" not in shown["stage"]
    assert "ready" in shown["stage"]["badge"]
    session.live.wait()
    last = list(steps)[-1]
    assert last["stage"]["badge"] == "Live preview" and last["stage"]["picture"] and "Ready" in last["progress"]


def test_the_list_and_what_is_wrong_with_it_are_shown(studio, session):
    (session.workspace / "edits.yaml").write_text("- edit: {click: [25, 24], box: [1, 1, 9, 9], hue: 50}\n")
    last = list(_opened(named(studio), session, session.project))[-1]
    assert len(last["steps"]) == 1 and "exactly one" in last["stage"]["badge"] and "alert" in last["progress"]
    session.act("remove", 0)
