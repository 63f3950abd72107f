"""The queue: order, limit, stop, failures."""

import sys
import time

import pytest

from materialist.studio import follow as words
from materialist.studio import jobs as queue
from materialist.studio.jobs import DONE, FAILED, QUEUED, RUNNING, STOPPED, Job, Jobs

WORKER = """
import json, os, sys, time
spec = json.loads(sys.stdin.readline())
tell = lambda **entry: print(json.dumps(entry), flush=True)
tell(stage="light", done=1, total=4)
open(os.path.join(spec["out"], f".partial-{os.getpid()}-host.png"), "w").close()
if spec["how"] == "wait":
    time.sleep(60)
if spec["how"] == "fail":
    tell(error="It is too dark.")
elif spec["how"] == "die":
    os.kill(os.getpid(), 9)
elif spec["how"] == "noise":
    print("not json"); print("[1, 2]"); tell(found="albedo", file="a.jpg"); tell(result={"a": 1})
else:
    tell(result={"a": 1, "device": spec["device"]})
"""


@pytest.fixture
def jobs(tmp_path, monkeypatch):
    script = tmp_path / "worker.py"
    script.write_text(WORKER)
    real = queue.subprocess.Popen
    monkeypatch.setattr(queue.subprocess, "Popen", lambda command, **more: real([sys.executable, str(script)], **more))
    made = Jobs(1)
    yield made
    made.close()


def ask(jobs: Jobs, how: str, folder, owner: str = "me") -> Job:
    (folder / "out").mkdir(exist_ok=True)
    return jobs.submit("invert", owner, folder / "out", how=how, out=str(folder / "out"))


def until(done, seconds: float = 10) -> None:
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end, "took too long"
        time.sleep(0.02)


def test_results_and_what_was_found(jobs, tmp_path):
    job = ask(jobs, "noise", tmp_path)
    assert list(words.follow(jobs, job))[-1].count("Done in") == 1
    assert job.state == DONE and job.result == {"a": 1} and job.found == [{"found": "albedo", "file": "a.jpg"}]


def test_failures_are_sentences_and_the_queue_goes_on(jobs, tmp_path):
    sad, dead, good = (ask(jobs, how, tmp_path) for how in ("fail", "die", "fine"))
    until(lambda: good.over)
    assert sad.state == FAILED and sad.message == "It is too dark."
    assert dead.state == FAILED and "-9" in dead.message
    assert good.state == DONE
    assert 'role="alert"' in words.shown(jobs, sad)


def test_order_limit_and_stop(jobs, tmp_path):
    first, second, third = ask(jobs, "wait", tmp_path), ask(jobs, "wait", tmp_path), ask(jobs, "fine", tmp_path, "bert")
    until(lambda: first.stage == "light")
    assert (first.state, second.state) == (RUNNING, QUEUED)
    assert jobs.ahead(second) == 1 and jobs.ahead(third) == 2
    assert "2 other pieces of work are before yours" in words.shown(jobs, third)
    assert jobs.of("me") == [second, first] and jobs.of("bert", "final") == []
    process = first.process
    jobs.stop(second)
    jobs.stop(first)
    until(lambda: third.over)
    assert third.result["device"] == "auto"
    assert (first.state, second.state, third.state) == (STOPPED, STOPPED, DONE)
    assert process.poll() is not None and second.process is None
    assert not list((tmp_path / "out").glob(f".partial-{process.pid}*"))
    jobs.stop(third)
    assert third.state == DONE


def test_closing_ends_the_worker(jobs, tmp_path):
    job = ask(jobs, "wait", tmp_path)
    until(lambda: job.stage == "light")
    jobs.close()
    until(lambda: job.process.poll() is not None)


def test_the_bar_never_runs_back(jobs, tmp_path):
    job = Job("invert", "me", {}, tmp_path, state=RUNNING)
    shares = []
    stages = [("read", 0), ("predict", 0), ("light", 60), ("light", 120), ("light", 1), ("glance", 0), ("trace", 9)]
    for stage, done in (*stages, ("materials", 5), ("light", 3), ("rerender", 0)):
        job.stage, job.done, job.total = stage, done, 120
        shares.append(words.share(job))
    assert shares == sorted(shares) and 0 < shares[2] < shares[3] < shares[6] < shares[-1] < 1


@pytest.mark.parametrize(
    ("stage", "text"),
    [
        ("light", "Finding the light"),
        ("light 2", "Finding the light"),
        ("glance", "Looking at the light"),
        ("odd", "Odd"),
    ],
)
def test_stages_in_words(stage, text):
    assert words.words(stage) == text


def test_words_cannot_carry_html():
    assert "<script>" not in words.box("<script>alert(1)</script>", bad=True)
