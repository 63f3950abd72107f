"""The studio's jobs: a queue with a limit, each job in a process of its own, and a stop that always works."""

import shutil
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from materialist.jobs.process import LOST, Worker, sentence
from materialist.jobs.worker import DONE, FAILED, INTERMEDIATE, PROGRESS

QUEUED = "queued"
RUNNING = "running"
STOPPED = "stopped"
"""States of a job, beside DONE and FAILED."""
NICENESS = 5
"""Of the processes: live previews go before."""


@dataclass
class Job:
    """One piece of work; changed by the queue alone, read by anyone."""

    kind: str
    owner: str
    """The person who asked for it (not the page), so that a reloaded page finds it."""
    folder: Path
    task: Callable[..., Any] = field(repr=False)
    """Importable function task(report, **arguments)."""
    arguments: dict[str, Any] = field(default_factory=dict)
    sender: str = ""
    """The address that it was asked for from."""
    state: str = QUEUED
    stage: str = ""
    done: int = 0
    total: int = 0
    message: str = ""
    """One sentence where it failed."""
    intermediate: list[dict[str, Any]] = field(default_factory=list)
    began: float = field(default_factory=time.monotonic)
    ended: float | None = None
    worker: Worker | None = field(default=None, repr=False)

    @property
    def over(self) -> bool:
        return self.state in (DONE, FAILED, STOPPED)

    @property
    def seconds(self) -> float:
        return (self.ended or time.monotonic()) - self.began

    def end(self, state: str, message: str = "") -> None:
        """Set the final state, unless it has one."""
        if not self.over:
            self.state = state
            self.message = message
            self.ended = time.monotonic()


class JobQueue:
    """Runs at most `limit` jobs at a time, in the order they came."""

    def __init__(self, limit: int = 1, memory: int = 0, seconds: float = 0.0):
        """limit: jobs at a time. memory: bytes of data of each. seconds: how long each may run. 0: no limit."""
        self._memory = memory
        self._seconds = seconds
        self._threads = ThreadPoolExecutor(limit, thread_name_prefix="job")
        self._lock = threading.Lock()
        self._jobs: list[Job] = []
        self._spare: Worker | None = None
        """A process that has loaded what jobs need, for the next one."""

    def warm(self, task: Callable[..., Any], seconds: float) -> None:
        """Start a process for the next job, and do a task in it, unless there is one; it ends after idle seconds."""
        with self._lock:
            if self._spare is not None and self._spare.running:
                return
            # Without it the next job starts its own.
            with suppress(OSError):
                self._spare = Worker(niceness=NICENESS, memory=self._memory, idle=seconds)
                self._spare.begin(task, {})

    def _worker(self) -> Worker:
        """The spare process, or a new one; the lock is held. Raises OSError."""
        spare, self._spare = self._spare, None
        if spare is not None and spare.running:
            return spare
        return Worker(niceness=NICENESS, memory=self._memory)

    def submit(self, job: Job) -> Job:
        with self._lock:
            # Jobs that are over are forgotten here: whoever follows one holds it.
            self._jobs = [*(j for j in self._jobs if not j.over), job]
        self._threads.submit(self._run, job)
        return job

    def ahead(self, job: Job) -> int:
        """How many jobs are before this one in the queue; 0 when it runs."""
        waiting = self.unfinished()
        return waiting.index(job) if job.state == QUEUED and job in waiting else 0

    def unfinished(self, owner: str | None = None, kind: str | None = None) -> list[Job]:
        """The jobs that wait or run: all, or those of a person, or of a kind."""
        with self._lock:
            return [
                j
                for j in self._jobs
                if owner in (None, j.owner) and kind in (None, j.kind) and not j.over
            ]

    def stop(self, job: Job) -> None:
        """End a job, in the queue or in the middle; nothing half-written stays."""
        with self._lock:
            # The state first: the lost worker then counts as stopped, not as failed.
            job.end(STOPPED)
            worker = job.worker
        if worker is not None:
            worker.kill()

    def close(self) -> None:
        for job in self.unfinished():
            self.stop(job)
        with self._lock:
            if self._spare is not None:
                self._spare.close()
        self._threads.shutdown(cancel_futures=True)

    def _run(self, job: Job) -> None:
        with self._lock:
            if job.over:
                return
            job.state = RUNNING
            job.stage = "start"
            job.began = time.monotonic()
            try:
                job.worker = worker = self._worker()
            except OSError as error:
                job.end(FAILED, f"The work cannot be started: {error}.")
                return
        # --- The task, with a timer that ends it where it takes too long ---
        number = worker.begin(job.task, job.arguments)
        too_long = threading.Timer(self._seconds, worker.kill)
        too_long.daemon = True
        if self._seconds:
            too_long.start()
        try:
            # --- Its messages, until it is done, fails or is lost ---
            for message in worker.messages():
                if message.number != number:
                    continue  # of the task that warmed it
                if message.kind in (DONE, FAILED, LOST):
                    worker.kill()
                    break
                if message.kind == PROGRESS:
                    job.stage = message.facts["stage"]
                    job.done = message.facts["done"]
                    job.total = message.facts["total"]
                elif message.kind == INTERMEDIATE:
                    job.intermediate = [*job.intermediate, message.facts]
        finally:
            too_long.cancel()
            worker.close()
            _sweep(job.folder, worker.pid)
        with self._lock:
            # A stop may have come first: then the job keeps that state.
            if message.kind == DONE:
                job.end(DONE)
            else:
                late = bool(self._seconds) and job.seconds >= self._seconds
                limit = f"It took more than {self._seconds / 60:.0f} minutes, which is the limit."
                job.end(FAILED, limit if late else sentence(message.facts))


def _sweep(folder: Path, pid: int) -> None:
    """Remove what a stopped worker was writing (`io.atomic.partial` names it)."""
    for leftover in folder.glob(f".*partial-{pid}-*"):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            leftover.unlink(missing_ok=True)
