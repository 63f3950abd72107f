"""Opening photos, without a page."""

import pytest
from studio_scenes import named

from materialist.studio.jobs import DONE, FAILED, STOPPED, Job
from materialist.studio.tab_open import _following


@pytest.mark.parametrize("end", [FAILED, STOPPED])
def test_a_photo_that_fails_leaves_the_open_one_known(hub, session, end):
    project = hub.work.new("Too dark", "me")
    job = Job("invert", "me", {}, project.folder, state=end)
    updates = list(_following(named(hub), session, project, job))
    assert updates[0]["last"] == hub.kept(project) and updates[-1]["last"] == hub.kept(session.project)
    assert not project.folder.exists()
    nothing = hub.session("an empty page", "me")
    project = hub.work.new("Too dark", "me")
    assert list(_following(named(hub), nothing, project, job))[-1]["last"] == ""
    hub.leave("an empty page")


def test_a_photo_that_is_done_stays_known(hub, session):
    project = hub.work.new("Fine", "me")
    job = Job("invert", "me", {}, project.folder, state=DONE)
    updates = list(_following(named(hub), session, project, job))
    assert [update["last"] for update in updates if "last" in update] == [hub.kept(project)]
