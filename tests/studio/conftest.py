"""A session on a small scene, and a studio that several people reach."""

import pytest
from live_here import live_here
from studio_scenes import package

from materialist.jobs.queue import JobQueue
from materialist.studio import uploads
from materialist.studio.edit_list import EditList
from materialist.studio.studio import Studio
from materialist.studio.workspace import WorkFolder


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studio")
    work = WorkFolder(folder / "work")
    made = Studio(work, JobQueue(1))
    made.start = work.new("Room", "me", scene=package(folder))
    yield made
    made.close()


@pytest.fixture
def opens_here(monkeypatch):
    """Uploads are opened in this process, which is faster, and sees limits that a test sets."""
    monkeypatch.setattr(uploads, "run_limited", lambda task, limits, **given: task(None, **given))


@pytest.fixture
def shared(tmp_path):
    """A studio that several people reach."""
    made = Studio(WorkFolder(tmp_path), JobQueue(1), single_user=False)
    yield made
    made.close()


@pytest.fixture(scope="module")
def opened(studio, clicks_once):
    page = studio.page("page", "me")
    with live_here():
        studio.open(page, studio.start.name)
        page.session.live.wait()
        yield page.session


@pytest.fixture
def session(opened):
    """The open session without edits."""
    opened.edits = EditList()
    opened.next_object = {}
    opened.deselect()
    opened._past = []
    (opened.workspace / "edits.yaml").unlink(missing_ok=True)  # a test may have left another page's
    opened._kept = None
    opened.save()
    return opened
