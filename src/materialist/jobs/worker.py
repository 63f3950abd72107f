"""The worker process: it does the tasks that come over a socket.

It is started as `python -m materialist.jobs.worker FD NICENESS IDLE MEMORY THREADS`.
It receives `(number, task)` and sends `(kind, facts, number)`. Of several waiting tasks it does the newest; with
THREADS it does all of them, so many at a time.
The process ends when the other end of the socket is closed, also in the middle of a task: a coordinator that was killed
leaves none behind. `multiprocessing` and pools on top of it (pebble) would run the caller's main module again in each
worker and import torch before the environment of a worker is set, so only its connections are used.
"""

import os
import pickle
import queue
import resource
import sys
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from multiprocessing.connection import Connection
from typing import Any

from materialist.errors import MaterialistError

PROGRESS = "progress"
INTERMEDIATE = "intermediate"
DONE = "done"
FAILED = "failed"
"""Kinds of messages. Facts of PROGRESS: stage, done, total; of INTERMEDIATE: what the task passes to `intermediate`;
DONE: what the task returned; of FAILED: see `failure_facts`."""
_NO_MEMORY = (
    "Insufficient memory",
    "Failed to allocate",
    "std::bad_alloc",
    "Cannot allocate memory",
)
"""Words of libraries for which no MemoryError is raised where memory runs out."""
INTERVAL = 0.1
"""Seconds between two messages about the progress of one stage."""


class Reporter:
    """Callback of a task: `report(stage, done, total)` for progress, `report.intermediate(...)` for a first result."""

    def __init__(
        self, send: Callable[[str, Any], None], waiting: Callable[[], bool] = lambda: False
    ):
        self._send = send
        self._waiting = waiting
        self._last = 0.0
        self.stage = "read"

    def __call__(self, stage: str, done: int, total: int) -> None:
        now = time.monotonic()
        # Not every step: messages would take longer than the work.
        if stage != self.stage or now - self._last > INTERVAL or done >= total:
            self.stage = stage
            self._last = now
            self._send(PROGRESS, {"stage": stage, "done": int(done), "total": int(total)})

    def intermediate(self, **facts: Any) -> None:
        """Send an intermediate result."""
        self._send(INTERMEDIATE, facts)

    @property
    def outdated(self) -> bool:
        """Whether a newer task waits."""
        return self._waiting()


def main(descriptor: int, niceness: int, idle: float, memory: int, threads: int = 0) -> None:
    """Do tasks until the socket is closed, or none came for `idle` seconds (0: wait for ever).

    memory: bytes of data that the process may hold, where the system can limit them; 0: no limit. threads: tasks
    that are done at a time, none of them left out; 0: one, the newest.
    """
    if memory:
        resource.setrlimit(resource.RLIMIT_DATA, (memory, memory))
    os.dup2(2, 1)  # what libraries print is not the output of the command that started this process
    os.nice(niceness)
    connection: Connection = Connection(descriptor)
    tasks: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    sending = threading.Lock()

    def receive() -> None:
        try:
            while True:
                tasks.put(connection.recv_bytes())
        except (EOFError, OSError):
            os._exit(3)  # nobody waits for the result

    def send(message: Any) -> None:
        try:
            with sending:
                connection.send(message)
        except OSError:
            os._exit(3)

    def do(content: bytes) -> None:
        # The task itself stays pickled until `run_task`, whose errors are reported.
        number, task = pickle.loads(content)
        report = Reporter(lambda *message: send((*message, number)), lambda: not tasks.empty())
        send((*run_task(task, report), number))

    threading.Thread(target=receive, daemon=True).start()
    pool = ThreadPoolExecutor(threads) if threads else None
    while True:
        try:
            content = tasks.get(timeout=idle or None)
        except queue.Empty:
            if connection.poll():
                continue  # the receiving thread is late
            os._exit(0)
        if pool is not None:
            pool.submit(do, content)
            continue
        # Only the newest: a slider has moved on.
        while not tasks.empty():
            content = tasks.get()
        do(content)


def run_task(task: bytes, report: Reporter) -> tuple[str, Any]:
    """(DONE, what a task returned) or (FAILED, why), of a pickled function and its keywords."""
    try:
        function, arguments = pickle.loads(task)
        return DONE, function(report, **arguments)
    except Exception as error:
        return FAILED, failure_facts(error, report.stage)


def failure_facts(error: BaseException, stage: str) -> dict[str, Any]:
    """An exception as texts: `error` (its type), `reason`, `stage`, `bug` (whether unexpected), `trace` of bugs.

    `out_of_memory` says whether memory ran out.

    An exception may bring more in its attribute `facts`.
    """
    bug = not isinstance(error, MaterialistError | MemoryError | OSError)
    reason = " ".join(str(error).split()) or type(error).__name__
    out_of_memory = isinstance(error, MemoryError) or any(word in reason for word in _NO_MEMORY)
    if isinstance(error, MemoryError):
        reason = "There is not enough memory for this; take a smaller size, or fewer workers."
    # A trace helps with bugs alone; an expected error says all in its sentence.
    trace = "".join(traceback.format_exception(error))[-4000:] if bug else None
    facts = {
        "error": type(error).__name__,
        "reason": reason,
        "stage": stage,
        "bug": bug,
        "trace": trace,
    }
    return {**getattr(error, "facts", {}), **facts, "out_of_memory": out_of_memory}


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3]), *map(int, sys.argv[4:]))
