"""Workers on this machine: processes of their own, one photo at a time each."""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
import tempfile
from typing import IO, Any

from materialist.batches.job import Job
from materialist.batches.news import DONE, FAILED, LOST, News
from materialist.errors import SetupError

PATIENCE = 3.0
"""Seconds that a worker has to end before it is killed."""


def worker_mb(size: int) -> float:
    """Memory to count on for a worker at a working size, MB: what was measured, 1.5 GB at 512 and 3.7 GB at 1024."""
    return 720 + 2.9e-3 * size**2


def default_workers(device: str = "auto", size: int = 512) -> int:
    """One for each GPU that may be used, else one for each processor as far as memory reaches."""
    gpus = visible_gpus() if device != "cpu" else []
    if gpus:
        return len(gpus)
    import psutil

    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(processors, int(psutil.virtual_memory().available / 1e6 / worker_mb(size))))


def visible_gpus() -> list[str]:
    """Names by which CUDA can be told to use one GPU; none where no driver answers."""
    from materialist.render.variant import cuda_usable

    if not cuda_usable():
        return []
    chosen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if chosen is not None:
        return [name.strip() for name in chosen.split(",") if name.strip()]
    import ctypes

    count = ctypes.c_int()
    ctypes.CDLL("nvcuda.dll" if sys.platform == "win32" else "libcuda.so.1").cuDeviceGetCount(ctypes.byref(count))
    return [str(k) for k in range(count.value)]


class LocalPool:
    """Worker processes; each is started when it is first needed, and again after it died. See `news.Pool`."""

    def __init__(self, workers: int, *, device: str = "auto") -> None:
        gpus = visible_gpus() if device != "cpu" else []
        self._selector = selectors.DefaultSelector()
        self._workers = [_Worker(self._selector, gpus[k % len(gpus)] if gpus else None) for k in range(workers)]
        self._proven = False

    def free(self) -> int:
        """Workers without a photo."""
        return sum(worker.job is None for worker in self._workers)

    def begin(self, job: Job) -> None:
        """Hand a photo to a free worker."""
        next(worker for worker in self._workers if worker.job is None).begin(job)

    def wait(self, seconds: float) -> list[News]:
        """What the workers said. Raises SetupError when none can start at all."""
        news: list[News] = []
        for key, _ in self._selector.select(seconds):
            said = key.data()
            news += said
            self._proven |= any(one.kind in (DONE, FAILED) for one in said)
            if not self._proven and any(one.facts.get("unready") for one in said):
                raise SetupError(f"A worker process does not start: {said[-1].facts['reason']}")
        return news

    def close(self) -> None:
        """End all workers."""
        for worker in self._workers:
            worker.end()
        for worker in self._workers:
            worker.reap()
        self._selector.close()


class _Worker:
    """One process, or the place for one."""

    def __init__(self, selector: selectors.BaseSelector, gpu: str | None) -> None:
        self.job: Job | None = None
        self._selector, self._gpu = selector, gpu
        self._process: subprocess.Popen[bytes] | None = None
        self._errors: IO[bytes] | None = None
        self._rest = b""
        self._ready = False

    def begin(self, job: Job) -> None:
        if self._process is None:
            self._start()
        assert self._process is not None and self._process.stdin is not None
        self.job = job
        try:
            self._process.stdin.write(job.to_text().encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it died while idle: the end of its stdout says so, and the job is counted as lost

    def end(self) -> None:
        """Ask the process to end; it ignores nothing but Ctrl-C."""
        if self._process is not None:
            self._process.terminate()

    def reap(self) -> int | None:
        """Wait for the end, and free the place; returns the exit code."""
        if self._process is None:
            return None
        process, self._process = self._process, None
        assert process.stdout is not None and process.stdin is not None
        self._selector.unregister(process.stdout)
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            code = process.wait()
        for pipe in (process.stdin, process.stdout):
            try:
                pipe.close()
            except OSError:
                continue
        return code

    def _start(self) -> None:
        from materialist.batches.work import ONE_THREAD

        environment = {**os.environ, **ONE_THREAD}
        if self._gpu is not None:
            environment["CUDA_VISIBLE_DEVICES"] = self._gpu
        if self._errors is not None:
            self._errors.close()
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 - read when the process has died
        # A new program, not a fork: a renderer that has started does not survive one.
        self._process = subprocess.Popen(
            [sys.executable, "-m", "materialist.batches.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._errors, env=environment,
        )  # fmt: skip
        assert self._process.stdout is not None
        os.set_blocking(self._process.stdout.fileno(), False)
        self._rest, self._ready = b"", False
        self._selector.register(self._process.stdout, selectors.EVENT_READ, self._hear)

    def _hear(self) -> list[News]:
        """What can be read now, as news; the end of the process is news where it had a photo."""
        assert self._process is not None and self._process.stdout is not None
        news = []
        chunk = os.read(self._process.stdout.fileno(), 1 << 16)
        *lines, self._rest = (self._rest + chunk).split(b"\n")
        for line in lines:
            said = json.loads(line)
            if said["kind"] == "ready":
                self._ready = True
            elif self.job is not None:
                news.append(News(said["kind"], self.job, said["facts"]))
                self.job = None if said["kind"] in (DONE, FAILED) else self.job
        if not chunk:
            lost, self.job = self.job, None
            facts = self._obituary(self.reap())
            news += [News(LOST, lost, facts)] if lost is not None else []
        return news

    def _obituary(self, code: int | None) -> dict[str, Any]:
        """Why the process ended, as far as can be told."""
        last = ""
        if self._errors is not None:
            size = self._errors.seek(0, os.SEEK_END)
            self._errors.seek(max(0, size - 2000))
            lines = self._errors.read().decode("utf-8", "replace").strip().splitlines()
            last = f" Its last words: {lines[-1][:300]}" if lines else ""
        if code is not None and code < 0:
            name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
            hint = " (as the system does when memory runs out)" if -code == signal.SIGKILL else ""
            reason = f"The worker process was ended by {name}{hint}."
        else:
            reason = f"The worker process ended with exit code {code}."
        unready = not self._ready and code is not None and code > 0
        return {"error": "WorkerLost", "reason": reason + last, "bug": False, "trace": None, "unready": unready}
