"""Worker processes: results, failures, death. Their pool, and the end of who started them: batches/test_kill.py."""

import pytest
from made_tasks import answer, until

from materialist.errors import SetupError
from materialist.jobs.pool import LocalPool
from materialist.jobs.process import LOST, Worker
from materialist.jobs.worker import DONE, FAILED, INTERMEDIATE, PROGRESS


def told(worker, how, **more):
    """The last message about a task, and the kinds of those before it."""
    worker.begin(answer, {"how": how, **more})
    kinds = []
    for message in worker.messages():
        if message.kind in (DONE, FAILED, LOST):
            return message, kinds
        kinds.append(message.kind)
    raise AssertionError


def test_one_process_does_task_after_task_until_it_dies():
    worker = Worker(environment={"OMP_NUM_THREADS": "7"}, keep_errors=True)
    done, kinds = told(worker, "found")
    assert (
        kinds == [PROGRESS, INTERMEDIATE]
        and done.facts["threads"] == "7"
        and done.facts["pid"] == worker.pid
    )
    failed, _ = told(worker, "fail")
    assert (
        failed.kind == FAILED
        and failed.facts["reason"] == "It is too dark."
        and failed.facts["stage"] == "light"
    )
    assert failed.facts["error"] == "InputError" and not failed.facts["bug"] and failed.number == 2
    bug = told(worker, "bug")[0].facts
    assert bug["bug"] and "RuntimeError: three is not four" in bug["trace"]
    lost, _ = told(worker, "die")
    assert lost.kind == LOST and "ended by SIGKILL" in lost.facts["reason"]
    assert "Its last words: LLVM ERROR: Cannot select" in lost.facts["reason"]
    assert not worker.running


def test_of_waiting_tasks_the_newest_is_done_and_the_running_one_knows():
    worker = Worker()
    first = worker.begin(answer, {"wait": 0.5})
    next(worker.messages())
    for how in ("skipped", "newest"):
        last = worker.begin(answer, {"how": how})
    done = []
    for message in worker.messages():
        done += [message] if message.kind == DONE else []
        if message.number == last and message.kind == DONE:
            break
    assert [message.number for message in done] == [first, last] and done[0].facts["outdated"]
    assert done[1].facts["how"] == "newest" and not done[1].facts["outdated"]
    worker.close()
    assert not worker.running


def test_an_idle_process_ends_by_itself():
    worker = Worker(idle=0.2)
    assert told(worker, "fine")[0].kind == DONE
    until(lambda: not worker.running)
    worker.close()


def test_a_worker_that_cannot_be_started_is_a_sentence(monkeypatch):
    def none(*words, **how):
        raise BlockingIOError(11, "Resource temporarily unavailable")

    monkeypatch.setattr("subprocess.Popen", none)
    with pytest.raises(SetupError, match="Resource temporarily unavailable; give fewer workers"):
        LocalPool([{}]).begin("a", answer, {})
