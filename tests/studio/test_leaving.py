"""What ends with a page, and what it leaves behind."""

import os

import pytest

from materialist.jobs.queue import QUEUED, STOPPED, Job
from materialist.studio.studio import Studio


@pytest.fixture
def page(studio, monkeypatch):
    """A second page on the small scene, and where its jobs would write."""
    waiting = []
    monkeypatch.setattr(studio.jobs, "_jobs", waiting)
    session = studio.session("a page that is closed", "me")
    studio.open(session, studio.start.name)
    yield session
    studio.leave("a page that is closed")


def asked(studio: Studio, session, kind: str) -> Job:
    """A job of a page that waits for its turn."""
    job = Job(kind, session.person, session.workspace, print)
    studio.jobs._jobs.append(job)
    session.note_job(job)
    return job


def test_renderings_end_with_their_page(studio, page):
    jobs = {kind: asked(studio, page, kind) for kind in ("final", "take", "fall", "invert", "mesh")}
    again = asked(studio, page, "final")  # the button pressed twice
    studio.leave("a page that is closed")
    assert [jobs[kind].state for kind in jobs] == [STOPPED] * 3 + [QUEUED] * 2 and again.state == STOPPED


def left(desk):
    return sorted(file.name for file in desk.iterdir() if file.name.startswith(("final-", "job-")))


def test_what_pages_left_goes_when_the_photo_is_opened_alone(studio, page):
    desk, project = page.workspace, page.project
    own, other = os.getpid(), os.getppid()
    names = [f"final-{own}-0a1b2c3d.png", "final-0a1b2c3d.exr", f"job-{own}-0123456789ab.yaml", "job-0123456789ab.yaml"]
    for name in (*names, f"final-{other}-0a1b2c3d.jpg"):
        (desk / name).touch()
    studio.leave("page")  # what other tests opened
    third = studio.session("a third page", "me")
    studio.open(third, project.name)
    assert len(left(desk)) == 5  # the second page has the photo open
    job = asked(studio, page, "mesh")
    studio.leave("a page that is closed")
    studio.open(third, project.name)
    assert len(left(desk)) == 5  # a job works there
    job.state = STOPPED
    studio.open(third, project.name)
    assert left(desk) == [f"final-{other}-0a1b2c3d.jpg"]  # of a studio that runs
    (desk / left(desk)[0]).unlink()
    studio.leave("a third page")
