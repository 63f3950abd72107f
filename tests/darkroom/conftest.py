"""The darkroom on a small scene: by requests alone, and in a real browser."""

import time
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="needs the studio extra")
pytest.importorskip("pydantic", reason="needs the studio extra")
import studio_server
from live_here import live_here, live_nowhere
from starlette.testclient import TestClient
from studio_scenes import package

from materialist.darkroom.app import application
from materialist.jobs.queue import JobQueue
from materialist.studio import uploads
from materialist.studio.studio import Studio
from materialist.studio.workspace import WorkFolder

ADDRESS = "http://127.0.0.1:7860"
CHANNEL = "ws://127.0.0.1:7860/api/channel?page=" + "b" * 32


@pytest.fixture
def shared(tmp_path):
    """A studio that several people reach, with the small scene for everybody."""
    work = WorkFolder(tmp_path / "work")
    made = Studio(work, JobQueue(1), single_user=False)
    made.start = work.new("Room", "nobody", scene=package(tmp_path))
    with live_nowhere():
        yield made
        made.close()


@pytest.fixture
def visit(shared):
    """visit(page, address): a browser of its own, whose requests come from an address and name a page."""
    gate = application(shared, host="0.0.0.0", port=0)

    def browser(page="a" * 32, address="1.2.3.4", arrive=True):
        headers = {"x-materialist-page": page, "origin": "http://studio.example"}
        client = TestClient(
            gate, base_url="http://studio.example", client=(address, 1), headers=headers
        )
        if arrive:
            assert client.get("/api/arrive").status_code == 200
        return client

    return browser


@pytest.fixture(scope="module")
def local(tmp_path_factory, clicks_once):
    """The open small scene on a page of this machine's own studio, as a client."""
    folder = tmp_path_factory.mktemp("local")
    work = WorkFolder(folder / "work")
    studio = Studio(work, JobQueue(1))
    studio.start = work.new("Room", "me", scene=package(folder))
    gate = application(studio, host="127.0.0.1", port=7860)
    headers = {"x-materialist-page": "b" * 32, "origin": ADDRESS}
    with (
        live_here(),
        pytest.MonkeyPatch.context() as patch,
        TestClient(gate, base_url=ADDRESS, headers=headers) as client,
    ):
        # `shared` opens uploads in a process of its own.
        patch.setattr(uploads, "run_limited", lambda task, limits, **given: task(None, **given))
        # With the channel the page is open between the tests, too.
        client.get("/")
        state = client.get("/api/arrive").json()
        assert state["project"]["title"] == "Room"
        with client.websocket_connect(CHANNEL):
            studio.page("b" * 32, "me").session.live.wait()
            client.studio = studio
            yield client
    studio.close()


@pytest.fixture
def client(local):
    """That page without edits."""
    session = local.studio.page("b" * 32, "me").session
    session.edits = type(session.edits)()
    session.next_object = {}
    session.deselect()
    session._past = []
    session.final = None
    session.save()
    # A test before this one may have opened a photo whose preview is still being built.
    if session.live is not None:
        session.live.wait()
    return local


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """(address, work folder, process) of the darkroom in a process of its own, on the small scene."""
    folder = tmp_path_factory.mktemp("browser")
    with studio_server.studio(folder, str(package(folder))) as (process, address):
        yield address, folder / "work", process
        # Whatever the tests did: what is large is in the processes of the photos alone.
        maps = Path(f"/proc/{process.pid}/maps")
        loaded = maps.read_text() if maps.is_file() else ""
        assert "libtorch" not in loaded and "mitsuba" not in loaded


@pytest.fixture
def heard(client):
    """heard(test): what the channel of that page says, once it passes a test."""

    def until(test, seconds=240):
        end = time.monotonic() + seconds
        with client.websocket_connect(CHANNEL) as channel:
            while True:
                news = channel.receive_json()
                if test(news):
                    return news
                assert time.monotonic() < end, news

    return until
