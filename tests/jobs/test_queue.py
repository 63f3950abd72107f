"""The queue of jobs: order, limit, stop, failures."""

import pytest
from made_tasks import answer, until

from materialist.jobs.queue import QUEUED, RUNNING, STOPPED, Job, JobQueue
from materialist.jobs.worker import DONE, FAILED


@pytest.fixture
def jobs():
    made = JobQueue(1)
    yield made
    made.close()


def ask(jobs: JobQueue, how: str, folder, owner: str = "me") -> Job:
    return jobs.submit(Job("invert", owner, folder, answer, {"how": how, "out": str(folder)}))


def test_results_failures_and_the_queue_goes_on(jobs, tmp_path):
    good, sad, bug, dead = (ask(jobs, how, tmp_path) for how in ("found", "fail", "bug", "die"))
    until(lambda: dead.over)
    assert good.state == DONE and good.intermediate == [{"name": "albedo", "file": "a.jpg"}]
    assert sad.state == FAILED and sad.message == "It is too dark."
    assert bug.message.startswith("Something went wrong inside (RuntimeError: three is not four)")
    assert dead.state == FAILED and "SIGKILL" in dead.message


def test_order_limit_and_stop(jobs, tmp_path):
    first = ask(jobs, "wait", tmp_path)
    second = ask(jobs, "wait", tmp_path)
    third = ask(jobs, "fine", tmp_path, "bert")
    until(lambda: first.stage == "light")
    assert (first.state, second.state) == (RUNNING, QUEUED)
    assert jobs.ahead(second) == 1 and jobs.ahead(third) == 2
    assert (
        jobs.unfinished("me", "invert") == [first, second]
        and jobs.unfinished("bert", "final") == []
    )
    until(lambda: list(tmp_path.glob(f".partial-{first.worker.pid}*")))
    jobs.stop(second)
    jobs.stop(first)
    until(lambda: third.over)
    assert (first.state, second.state, third.state) == (STOPPED, STOPPED, DONE)
    assert not first.worker.running and second.worker is None
    assert not list(tmp_path.glob(f".partial-{first.worker.pid}*"))
    jobs.stop(third)
    assert third.state == DONE


def test_closing_ends_the_worker(jobs, tmp_path):
    job = ask(jobs, "wait", tmp_path)
    until(lambda: job.stage == "light")
    jobs.close()
    until(lambda: not job.worker.running)
