"""What ends with a page, and what it leaves behind."""

import os

import pytest

from materialist.studio.hub import Hub
from materialist.studio.jobs import QUEUED, STOPPED, Job


@pytest.fixture
def page(hub, monkeypatch):
    """A second page on the small scene, and where its jobs would write."""
    waiting = []
    monkeypatch.setattr(hub.jobs, "_jobs", waiting)
    session = hub.session("a page that is closed", "me")
    hub.open(session, hub.start.name)
    yield session
    hub.leave("a page that is closed")


def asked(hub: Hub, session, kind: str) -> Job:
    """A job of a page that waits for its turn."""
    job = Job(kind, session.person, {}, session.desk)
    hub.jobs._jobs.append(job)
    session.asked(kind, job)
    return job


def test_renderings_end_with_their_page(hub, page):
    jobs = {kind: asked(hub, page, kind) for kind in ("final", "take", "fall", "invert", "mesh")}
    again = asked(hub, page, "final")  # the button pressed twice
    hub.leave("a page that is closed")
    assert [jobs[kind].state for kind in jobs] == [STOPPED] * 3 + [QUEUED] * 2 and again.state == STOPPED


def left(desk):
    return sorted(file.name for file in desk.iterdir() if file.name.startswith(("final-", "job-")))


def test_what_pages_left_goes_when_the_photo_is_opened_alone(hub, page):
    desk, project = page.desk, page.project
    own, other = os.getpid(), os.getppid()
    names = [f"final-{own}-0a1b2c3d.png", "final-0a1b2c3d.exr", f"job-{own}-0123456789ab.yaml", "job-0123456789ab.yaml"]
    for name in (*names, f"final-{other}-0a1b2c3d.jpg"):
        (desk / name).touch()
    hub.leave("page")  # what other tests opened
    third = hub.session("a third page", "me")
    hub.open(third, project.name)
    assert len(left(desk)) == 5  # the second page has the photo open
    job = asked(hub, page, "mesh")
    hub.leave("a page that is closed")
    hub.open(third, project.name)
    assert len(left(desk)) == 5  # a job works there
    job.state = STOPPED
    hub.open(third, project.name)
    assert left(desk) == [f"final-{other}-0a1b2c3d.jpg"]  # of a studio that runs
    (desk / left(desk)[0]).unlink()
    hub.leave("a third page")
