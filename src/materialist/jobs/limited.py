"""One task in a process of its own, with limits of memory and time: for files that strangers made."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any

from materialist.errors import InputError
from materialist.jobs.process import LOST, Message, Worker
from materialist.jobs.worker import DONE, FAILED


@dataclass(frozen=True)
class Limits:
    """What a task may use."""

    memory: int  # bytes of data of its process; 0: no limit
    seconds: float  # from the start of its process to its result


def run_limited(task: Callable[..., Any], limits: Limits, **arguments: Any) -> Any:
    """What `task(report, **arguments)` returns, done in a new process.

    Nothing of the task stays in this process, and its process does not see the passwords of this one.

    Raises InputError: the task raised an error of ours (with its sentence), failed in another way, used more than
    the limits, or ended its process.
    """
    deadline = time.monotonic() + limits.seconds
    secrets_removed = {"MATERIALIST_PASSWORD": ""}
    worker = Worker(environment=secrets_removed, memory=limits.memory, keep_errors=True)
    try:
        worker.begin(task, arguments)
        message = _last_message(worker, deadline)
    finally:
        worker.kill()
        worker.close()
    if message is None:
        raise InputError(f"It takes more than {limits.seconds:g} s to open; give a smaller file.")
    if message.kind == DONE:
        return message.facts
    raise InputError(_reason(message, limits))


def _last_message(worker: Worker, deadline: float) -> Message | None:
    """The message that ends a task; None where it does not come in time."""
    while True:
        # `wait` returns as soon as a message is there, and at the deadline in any case.
        left = deadline - time.monotonic()
        if left <= 0 or not wait([worker.connection], left):
            return None
        for message in worker.receive():
            if message.kind in (DONE, FAILED, LOST):
                return message


def _reason(message: Message, limits: Limits) -> str:
    """Why a task failed, as a sentence for who sent the file."""
    facts = message.facts
    # Some libraries end the process where they get no memory.
    if facts["out_of_memory"] or message.kind == LOST:
        return f"It is damaged, or needs more than {limits.memory / 1e9:g} GB of memory to open; give a smaller file."
    if facts["bug"]:
        return f"It cannot be read ({facts['error']}); export it again."
    return str(facts["reason"])
