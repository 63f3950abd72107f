"""The process of a live preview: what it answers, and that the photo outlives it."""

import os
import signal
import threading

import made_tasks
import psutil
import pytest
from made_tasks import until
from studio_scenes import block, package

from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.studio.access.quota import Allowance, Quota
from materialist.studio.live import views
from materialist.studio.live.process import Live
from materialist.studio.workspace import write_mask


@pytest.fixture
def quota(tmp_path):
    return Quota(tmp_path)


@pytest.fixture
def live(tmp_path, quota):
    """The open small scene, and its process."""
    made = Live(package(tmp_path), tmp_path / "t.npz", Allowance(quota, lambda: "somebody"))
    yield made
    made.close()


@pytest.fixture
def step(tmp_path):
    return Step("edit", {"mask": write_mask(tmp_path, block()), "hue": "120"}, tmp_path)


@pytest.mark.slow  # the page's tests ask such a process, too
def test_the_process_answers_and_ends_with_the_photo(live, step, tmp_path):
    # Selecting does not wait for the tables.
    assert live.call(views.selected, where={"click": (25, 24)})[24, 25]
    live.wait()
    assert live.ready
    until(lambda: live.fine)
    assert live.call(views.picture, steps=(step,), panes={}).startswith(b"\xff\xd8")
    # Errors come with their class and sentence.
    with pytest.raises(InputError, match="must lie in"):
        live.call(views.check, steps=(Step("edit", {**step.options, "roughness": "7"}, tmp_path),))
    process = live.process
    live.close()
    until(lambda: not psutil.pid_exists(process))
    with pytest.raises(InputError, match="was closed"):
        live.call(views.check, steps=())


@pytest.mark.slow
def test_a_process_that_is_gone_is_replaced(monkeypatch, request, quota, tmp_path):
    """Whatever it is asked: here it loads no torch, which takes longer than all else."""
    monkeypatch.setattr(
        "materialist.studio.live.process.open_preview", made_tasks.open_without_pictures
    )
    live = request.getfixturevalue("live")
    step = request.getfixturevalue("step")
    live.wait()
    # Unused it ends, and the page does not see that: the next question starts another one.
    first = live.process
    live.rest(60)
    assert live.process == first
    live.rest(0)
    until(lambda: not psutil.pid_exists(first))
    assert live.ready and live.process is None
    assert live.call(views.region, step=step).sum() == block().sum()
    # Ended by the system, it is told in words, once.
    os.kill(live.process, signal.SIGSTOP)
    second = live.process
    future = live._begin(views.check, {"steps": (step,)})
    os.kill(second, signal.SIGKILL)
    with pytest.raises(InputError, match="ended: The worker process was ended by SIGKILL"):
        future.result(30)

    # A call asks another process once, and tells of the second that is lost.
    def kill():
        os.kill(live.process, signal.SIGKILL)

    assert live.call(views.region, step=step).any()
    os.kill(live.process, signal.SIGSTOP)
    threading.Timer(0.3, kill).start()
    assert live.call(views.check, steps=(step,)) == ("It is too dark.",)
    # A second fall of one person waits for the first.
    fall = Step("drop", {"mesh": "x.ply", "at": ["5", "5"]}, tmp_path)
    with quota.opening("somebody"), pytest.raises(InputError, match="being opened"):
        live.call(views.check, steps=(fall,))
    assert live.call(views.region, step=step).sum() == block().sum()


def test_a_studio_that_ends_takes_its_previews_along(shared, tmp_path):
    project = shared.work.new("Room", "me", scene=package(tmp_path))
    page = shared.page("page", "me")
    shared.open(page, project.name)
    process = page.session.live.process
    assert psutil.pid_exists(process)
    shared.close()
    until(lambda: not psutil.pid_exists(process))
