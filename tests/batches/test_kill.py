"""Batches that are killed: what is left can be gone on with, and nobody goes on without them."""

import json
import os
import signal
import subprocess
import sys

import psutil
import pytest
from made_batch import photos, run
from made_tasks import until

from materialist.batches.ledger import LEDGER, read_events

NAMES = ("slow1", "slow2", "slow3", "slow4", "quick")

COMMAND = """
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job starts with it ignored
import materialist as mt
from materialist.cli import main
real = mt.batch
mt.batch = lambda *given, **how: real(*given, **how | {{"function": "made_batch:moody"}})
sys.argv = ["materialist", *{arguments!r}]
main()
"""


def done(runs):
    path = runs / LEDGER
    return [e for e in read_events(path) if e["event"] == "done"] if path.exists() else []


def workers_of(process):
    return [
        c
        for c in psutil.Process(process.pid).children()
        if "materialist.jobs.worker" in c.cmdline()
    ]


def command(source, runs):
    arguments = ["batch", source, "-o", runs, "--workers", 2, "--device", "cpu", "--json"]
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND.format(arguments=[str(a) for a in arguments])],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
        text=True,
    )


@pytest.mark.slow
def test_a_killed_driver_takes_its_workers_with_it_and_resume_gives_the_same_result(
    tmp_path, monkeypatch
):
    source = photos(tmp_path / "in", *NAMES)
    runs = tmp_path / "runs"
    monkeypatch.setenv("MADE_SLOW", "30")  # the second batch of photos is at work when it is killed
    process = command(source, runs)
    until(lambda: len(done(runs)) >= 1, 60)
    workers = until(lambda: workers_of(process), 60)
    process.kill()
    process.wait()
    gone, alive = psutil.wait_procs(workers, timeout=20)
    assert not alive and gone
    before = len(done(runs))
    assert before < len(NAMES)
    monkeypatch.setenv("MADE_SLOW", "0.1")
    outcome = run(source, runs, resume=True)
    assert outcome.kept == before and outcome.exit_code == 0
    assert outcome.hash == run(source, tmp_path / "fresh").hash
    assert not [p.name for p in runs.iterdir() if "partial" in p.name]


@pytest.mark.slow
def test_a_killed_worker_costs_its_photo_one_more_try(tmp_path, monkeypatch):
    monkeypatch.setenv("MADE_SLOW", "1")
    source = photos(tmp_path / "in", *NAMES)
    runs = tmp_path / "runs"
    process = command(source, runs)
    until(lambda: len(done(runs)) >= 1, 60)
    until(lambda: workers_of(process), 60)[0].kill()
    assert process.wait(60) == 0, process.stderr.read()
    attempts = [entry["attempts"] for entry in done(runs)]
    assert sorted(attempts) in (
        [1, 1, 1, 1, 2],
        [1] * 5,
    )  # killed between two photos, it costs nothing
    monkeypatch.setenv("MADE_SLOW", "0")
    assert (
        json.loads((runs / "summary.json").read_text())["hash"]
        == run(source, tmp_path / "fresh").hash
    )


@pytest.mark.parametrize("whole_group", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_ctrl_c_ends_the_workers_and_says_how_to_go_on(tmp_path, monkeypatch, whole_group):
    monkeypatch.setenv("MADE_SLOW", "30")
    source = photos(tmp_path / "in", *NAMES)
    runs = tmp_path / "runs"
    process = command(source, runs)
    until(lambda: len(done(runs)) >= 1, 60)
    workers = until(lambda: workers_of(process), 60)
    (os.killpg if whole_group else os.kill)(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 130 and "Traceback" not in err and "--resume" in err
    assert json.loads(out.splitlines()[-1])["error"] == "Interrupted"
    assert not psutil.wait_procs(workers, timeout=5)[1]
    assert json.loads((runs / "summary.json").read_text())["open"] == len(NAMES) - len(done(runs))
