"""A session on a small scene; a studio that runs on it, and pages of a browser."""

import pytest
import studio_browser
import studio_server
from studio_scenes import package

from materialist.jobs.queue import JobQueue
from materialist.studio import uploads
from materialist.studio.edit_list import EditList
from materialist.studio.studio import Studio
from materialist.studio.workspace import WorkFolder


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """(address, work folder) of a studio that was started on the small scene; it goes on with what was opened last."""
    pytest.importorskip("gradio", reason="needs gradio")
    folder = tmp_path_factory.mktemp("browser")
    with studio_server.studio(folder, str(package(folder))) as (_, address):
        yield address, folder / "work"


@pytest.fixture
def empty_page(browser):
    """A page of a new browser that notes its requests and the errors in it, refused content too."""
    context = browser.new_context(viewport={"width": 1280, "height": 1000}, accept_downloads=True)
    made = context.new_page()
    made.requested = []
    made.errors = []
    made.on("request", lambda request: made.requested.append(request.url))

    def refused(words):
        return made.errors.append(words) if "Content Security Policy" in words else None

    made.on("console", lambda message: refused(message.text))
    made.on("pageerror", lambda error: made.errors.append(str(error)))
    made.set_default_timeout(40_000)
    yield made
    context.close()


@pytest.fixture
def page(empty_page, running):
    """The small scene on a page, without edits; those that a test makes go with it."""
    address, work = running
    studio_browser.opened(empty_page, address)
    yield empty_page
    for file in work.glob("photo-*/edits-me/edits.yaml"):
        file.unlink()


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    folder = tmp_path_factory.mktemp("studio")
    work = WorkFolder(folder / "work")
    made = Studio(work, JobQueue(1))
    made.start = work.new("Room", "me", scene=package(folder))
    yield made
    made.jobs.close()


@pytest.fixture
def opens_here(monkeypatch):
    """Uploads are opened in this process, which is faster, and sees limits that a test sets."""
    monkeypatch.setattr(uploads, "run_limited", lambda task, limits, **given: task(None, **given))


@pytest.fixture
def shared(tmp_path):
    """A studio that several people reach."""
    made = Studio(WorkFolder(tmp_path), JobQueue(1), single_user=False)
    yield made
    made.jobs.close()


@pytest.fixture(scope="module")
def opened(studio):
    session = studio.session("page", "me")
    studio.open(session, studio.start.name)
    session.live.wait()
    return session


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
