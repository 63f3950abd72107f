"""Workers of a Ray cluster: one task a photo. RUNS and the photos must lie where every machine of it can reach them."""

from __future__ import annotations

import socket
from typing import Any

from materialist.batches.job import Job
from materialist.batches.news import DONE, FAILED, LOST, News, describe
from materialist.batches.work import ONE_THREAD
from materialist.errors import SetupError

PATIENCE = 10.0
"""Seconds that a cluster has to take the phone."""
LOCAL = "local"
"""The address that means: a cluster of this machine alone, for as long as the batch."""


class RayPool:
    """Tasks on the cluster at an address (`ray://HOST:10001`, `HOST:6379`, `auto`) or `local`. See `news.Pool`.

    A task takes one processor, and one GPU where the cluster has any and the device is not `cpu`. Ray's own retries are
    off: the batch counts them. Raises SetupError where Ray is not installed or does not answer.
    """

    def __init__(self, address: str, *, workers: int | None = None, device: str = "auto") -> None:
        ray = self._ray = _ray()
        local = address == LOCAL
        _knock(address)
        try:
            # No 'address' here: a cluster that happens to run on this machine is not what was asked for.
            place: dict[str, Any] = {"address": "local", "num_cpus": workers} if local else {"address": address}
            ray.init(
                **place, log_to_driver=False, configure_logging=False, include_dashboard=False if local else None,
                runtime_env={"env_vars": ONE_THREAD},
            )  # fmt: skip
        except Exception as error:
            reason = " ".join(str(error).split())
            raise SetupError(
                f"The Ray cluster at '{address}' does not answer: {reason[:300]} If it runs, RAY_AUTH_MODE and the "
                "token (~/.ray/auth_token, or RAY_AUTH_TOKEN) must be those of the cluster."
            ) from error
        resources = ray.cluster_resources()
        gpu = device != "cpu" and resources.get("GPU", 0) >= 1
        capacity = int(resources.get("GPU" if gpu else "CPU", 1))
        self._limit = max(1, min(workers or capacity, capacity))
        self._task = ray.remote(num_cpus=1, num_gpus=1 if gpu else 0, max_retries=0)(_do)
        self._running: dict[Any, Job] = {}

    def free(self) -> int:
        """Tasks that may be added: only as many as can run are handed out, so that a million photos need no memory."""
        return self._limit - len(self._running)

    def begin(self, job: Job) -> None:
        """Start a task."""
        self._running[self._task.remote(job.to_text())] = job

    def wait(self, seconds: float) -> list[News]:
        """Results of tasks that have ended."""
        if not self._running:
            return []
        ended, _ = self._ray.wait(list(self._running), num_returns=1, timeout=seconds)
        news = []
        for reference in ended:
            job = self._running.pop(reference)
            try:
                kind, facts = self._ray.get(reference)
            except (self._ray.exceptions.RayError, OSError) as error:
                words = f"Its worker on the cluster was lost ({type(error).__name__})."
                kind, facts = LOST, {"error": "WorkerLost", "reason": words, "bug": False, "trace": None}
            news.append(News(kind, job, facts))
        return news

    def close(self) -> None:
        """End the tasks that run, and leave the cluster."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()
        self._ray.shutdown()


def _do(text: str) -> tuple[str, dict[str, Any]]:
    """The task: a job done, and how it went. It raises nothing, for what it raised might not be known elsewhere."""
    from materialist.batches.work import process

    stage = ["read"]

    def tick(name: str, done: int, total: int) -> None:
        stage[0] = name

    try:
        return DONE, process(Job.from_text(text), tick)
    except Exception as error:
        return FAILED, describe(error, stage[0])


def _knock(address: str) -> None:
    """Raise SetupError where nobody listens at HOST:PORT: Ray itself would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), PATIENCE).close()
    except (OSError, OverflowError) as error:
        raise SetupError(f"The Ray cluster at '{address}' does not answer: {error}.") from error


def _ray() -> Any:
    try:
        import ray
    except ModuleNotFoundError as error:
        raise SetupError("--ray needs Ray; install it with: pip install 'materialist[ray]'") from error
    return ray
