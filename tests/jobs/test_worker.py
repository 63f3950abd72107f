"""Worker processes and pools: results, failures, death, and the end of the coordinator."""

import subprocess
import sys

import psutil
from made_tasks import answer, until

from materialist.jobs.pool import LocalPool
from materialist.jobs.process import LOST, Worker
from materialist.jobs.worker import DONE, FAILED, FOUND, PROGRESS

COORDINATOR = """
import sys, time
from made_tasks import answer, until
from materialist.jobs.process import Worker
worker = Worker()
worker.begin(answer, {"how": "wait"})
next(worker.messages())
print(worker.pid, flush=True)
time.sleep(60)
"""


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
    assert kinds == [PROGRESS, FOUND] and done.facts["threads"] == "7" and done.facts["pid"] == worker.pid
    failed, _ = told(worker, "fail")
    assert failed.kind == FAILED and failed.facts["reason"] == "It is too dark." and failed.facts["stage"] == "light"
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


def test_a_dead_coordinator_leaves_no_process():
    process = subprocess.Popen([sys.executable, "-c", COORDINATOR], stdout=subprocess.PIPE, text=True)
    worker = psutil.Process(int(process.stdout.readline()))
    process.kill()
    process.communicate()
    assert not psutil.wait_procs([worker], timeout=15)[1]


def test_a_pool_replaces_dead_workers_and_keeps_the_others():
    pool = LocalPool([{}, {}])
    for key, how in (("a", "wait"), ("b", "die")):
        pool.begin(key, answer, {"how": how})
    assert pool.free() == 0
    kinds = {}
    while pool.free() == 0:
        for key, message in pool.wait(5):
            kinds[key] = message.kind
    assert kinds.pop("b") == LOST and set(kinds.values()) <= {PROGRESS}  # the other works on
    pool.begin("c", answer, {})
    while kinds.get("c") != DONE:
        for key, message in pool.wait(5):
            kinds[key] = message.kind
    pool.close()
    assert pool.free() == 2 and pool.wait(0) == []
