"""Long work in processes of their own: a queue with a limit, progress in words, and a stop that always works."""

from __future__ import annotations

import subprocess
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from materialist.studio import child

WORKER = "materialist.studio.worker"
QUEUED, RUNNING, DONE, FAILED, STOPPED = "queued", "running", "done", "failed", "stopped"
KEPT_SECONDS = 3600
"""How long a finished job is remembered, so that a page that was reloaded can ask for its outcome."""


@dataclass
class Job:
    """One piece of work; changed by the queue alone, read by anyone."""

    kind: str
    owner: str
    """Who asked for it: the person, not the page, so that a reloaded page finds it."""
    spec: dict[str, Any]
    """What the worker is told."""
    folder: Path
    """Where it writes."""
    state: str = QUEUED
    stage: str = ""
    done: int = 0
    total: int = 0
    shown: float = 0.0
    """The longest that its bar was, in [0, 1]: it never runs back."""
    message: str = ""
    """One sentence where it failed."""
    found: list[dict[str, Any]] = field(default_factory=list)
    """Pictures that were found on the way: name and file."""
    result: dict[str, Any] = field(default_factory=dict)
    began: float = field(default_factory=time.monotonic)
    ended: float | None = None
    process: subprocess.Popen[str] | None = field(default=None, repr=False)

    @property
    def over(self) -> bool:
        return self.state in (DONE, FAILED, STOPPED)

    @property
    def seconds(self) -> float:
        return (self.ended or time.monotonic()) - self.began


class Jobs:
    """Runs at most `limit` jobs at a time, in the order they came, on a device of `invert`."""

    def __init__(self, limit: int = 1, device: str = "auto"):
        self.device = device
        self._pool = ThreadPoolExecutor(limit, thread_name_prefix="job")
        self._lock = threading.Lock()
        self._jobs: list[Job] = []

    def submit(self, kind: str, owner: str, folder: Path, **spec: Any) -> Job:
        """Put a job in the queue."""
        job = Job(kind, owner, {"kind": kind, **spec}, folder)
        with self._lock:
            now = time.monotonic()
            self._jobs = [j for j in self._jobs if not j.over or now - (j.ended or now) < KEPT_SECONDS]
            self._jobs.append(job)
        self._pool.submit(self._run, job)
        return job

    def run_now(self, kind: str, owner: str, folder: Path, **spec: Any) -> Job:
        """Run a short job at once, beside the queue; returns when it is over."""
        job = Job(kind, owner, {"kind": kind, **spec}, folder)
        self._run(job)
        return job

    def ahead(self, job: Job) -> int:
        """How many jobs are before this one in the queue; 0 when it runs."""
        with self._lock:
            waiting = [j for j in self._jobs if not j.over]
        return waiting.index(job) if job.state == QUEUED and job in waiting else 0

    def of(self, owner: str, kind: str | None = None) -> list[Job]:
        """The jobs of a person, the last first."""
        with self._lock:
            return [j for j in reversed(self._jobs) if j.owner == owner and kind in (None, j.kind)]

    def stop(self, job: Job) -> None:
        """End a job, in the queue or in the middle; nothing half-written stays."""
        with self._lock:
            if job.over:
                return
            job.state, job.ended = STOPPED, time.monotonic()
            process = job.process
        if process is not None:
            child.kill(process)

    def close(self) -> None:
        """Stop everything."""
        with self._lock:
            open_jobs = [j for j in self._jobs if not j.over]
        for job in open_jobs:
            self.stop(job)
        self._pool.shutdown(wait=False, cancel_futures=True)

    def _run(self, job: Job) -> None:
        with self._lock:
            if job.over:
                return
            job.state, job.stage, job.began = RUNNING, "start", time.monotonic()
            try:
                job.process = child.start(WORKER)
            except OSError as error:
                job.state, job.message, job.ended = FAILED, f"The work cannot be started: {error}.", time.monotonic()
                return
        process = job.process
        try:
            child.ask(process, {**job.spec, "device": self.device})
            for entry in child.lines(process):
                _take(job, entry)
            code = process.wait()
        finally:
            child.close(process)
            _sweep(job.folder, process.pid)
        with self._lock:
            if not job.over:
                job.ended = time.monotonic()
                job.state = DONE if job.result else FAILED
                job.message = job.message or ("" if job.result else f"The work ended without a result (code {code}).")


def _take(job: Job, entry: dict[str, Any]) -> None:
    if "stage" in entry:
        job.stage, job.done, job.total = entry["stage"], entry["done"], entry["total"]
    elif "found" in entry:
        job.found = [*job.found, entry]
    elif "result" in entry:
        job.result = entry["result"]
    elif "error" in entry:
        job.message = entry["error"]


def _sweep(folder: Path, pid: int) -> None:
    """Remove what a stopped worker was writing."""
    import shutil

    for leftover in folder.glob(f".*partial-{pid}-*"):
        if leftover.is_dir():
            shutil.rmtree(leftover, ignore_errors=True)
        else:
            leftover.unlink(missing_ok=True)
