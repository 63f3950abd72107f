"""What ends with a page, and what it leaves behind."""

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
    jobs = {kind: asked(studio, page, kind) for kind in ("final", "take", "invert", "mesh")}
    again = asked(studio, page, "final")  # the button pressed twice
    studio.leave("a page that is closed")
    assert [jobs[kind].state for kind in jobs] == [STOPPED] * 2 + [QUEUED] * 2 and again.state == STOPPED
