"""Tasks on files of strangers: results, sentences, and limits of memory and time."""

import os

import made_tasks
import numpy as np
import psutil
import pytest

from materialist.errors import InputError
from materialist.jobs.limited import Limits, run_limited

ENOUGH = Limits(memory=1_000_000_000, seconds=60)


def test_a_task_is_done_in_another_process_without_our_password(monkeypatch):
    monkeypatch.setenv("MATERIALIST_PASSWORD", "open sesame")
    facts = run_limited(made_tasks.surroundings, ENOUGH)
    assert facts["pid"] != os.getpid()
    assert not facts["password"]


@pytest.mark.parametrize(
    ("how", "words"),
    [
        ("fail", "It is too dark."),
        ("bug", r"cannot be read \(RuntimeError\)"),
        ("die", "is damaged"),
    ],
)
def test_a_failure_is_a_sentence(how, words):
    with pytest.raises(InputError, match=words):
        run_limited(made_tasks.answer, ENOUGH, how=how)


def test_too_much_memory_is_a_sentence():
    assert run_limited(made_tasks.allocate, ENOUGH, count=1_000_000) == 8_000_000
    with pytest.raises(InputError, match="needs more than 1 GB of memory"):
        run_limited(made_tasks.allocate, ENOUGH, count=200_000_000)


def test_too_much_time_is_a_sentence_and_the_process_ends():
    before = {child.pid for child in psutil.Process().children()}
    with pytest.raises(InputError, match="more than 2 s to open"):
        run_limited(made_tasks.wait, Limits(memory=0, seconds=2))
    assert {child.pid for child in psutil.Process().children()} <= before


def test_arrays_come_back():
    assert np.array_equal(run_limited(made_tasks.numbers, ENOUGH, count=3), [0, 1, 2])
