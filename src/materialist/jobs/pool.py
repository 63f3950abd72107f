"""Pools of workers, each with one task at a time: processes of this machine, or tasks of a Ray cluster."""

import pickle
import socket
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import Any

from materialist.errors import SetupError
from materialist.install import extra_command
from materialist.jobs.process import LOST, Message, Worker
from materialist.jobs.worker import DONE, FAILED, Reporter, run_task


@dataclass
class _Place:
    environment: dict[str, str]
    worker: Worker | None = None
    key: Hashable | None = None


class LocalPool:
    """One worker process for each environment; started when it is first needed, and again after it died."""

    def __init__(self, environments: list[dict[str, str]]) -> None:
        """`environments`: environment variables of each worker that differ from those of this process."""
        self._places = [_Place(environment) for environment in environments]

    def free(self) -> int:
        return sum(place.key is None for place in self._places)

    def begin(self, key: Hashable, task: Callable[..., Any], arguments: dict[str, Any]) -> None:
        place = next(place for place in self._places if place.key is None)
        try:
            place.worker = place.worker or Worker(environment=place.environment, keep_errors=True)
        except OSError as error:
            raise SetupError(
                f"A worker process cannot be started: {error}; give fewer workers."
            ) from error
        place.key = key
        place.worker.begin(task, arguments)

    def wait(self, seconds: float) -> list[tuple[Any, Message]]:
        """(key of the task, message): as soon as there is one, and none after `seconds`."""
        begun = {
            place.worker.connection: place for place in self._places if place.worker is not None
        }
        messages = []
        for connection in wait(list(begun), seconds):
            place = begun[connection]  # type: ignore[index]
            assert place.worker is not None
            for message in place.worker.receive():
                if place.key is not None:
                    messages.append((place.key, message))
                if message.kind in (DONE, FAILED, LOST):
                    place.key = None
                if message.kind == LOST:
                    place.worker = None
        return messages

    def close(self) -> None:
        """End all workers, also those at work."""
        workers = [place.worker for place in self._places if place.worker is not None]
        # First all are told to end, then each is waited for: they end side by side.
        for worker in workers:
            worker.kill()
        for worker in workers:
            worker.close()
        self._places = [_Place(place.environment) for place in self._places]


class RayPool:
    """Tasks on the Ray cluster at an address (`ray://HOST:10001`, `HOST:6379`, `auto`) or `local`.

    Files must lie where every machine of the cluster can reach them. A task takes one processor, or one GPU with `gpu`
    where the cluster has any. Ray's own retries are off: the batch counts them. Raises SetupError where Ray is not
    installed or does not answer.
    """

    def __init__(
        self,
        address: str,
        environment: dict[str, str],
        *,
        workers: int | None = None,
        gpu: bool = True,
    ):
        try:
            import ray
        except ModuleNotFoundError as error:
            raise SetupError(
                f"Workers on Ray need Ray; install it with: {extra_command('ray')}"
            ) from error
        self._ray = ray
        local = address == "local"  # a cluster of this machine alone, which ends with the pool
        # --- Connect ---
        _check_reachable(address)
        try:
            # 'local', not the address of a cluster that happens to run on this machine: it was not asked for.
            place: dict[str, Any] = (
                {"address": "local", "num_cpus": workers} if local else {"address": address}
            )
            # Results are fetched by the pool, not printed by workers.
            ray.init(
                **place,
                log_to_driver=False,
                configure_logging=False,
                include_dashboard=False if local else None,
                runtime_env={"env_vars": environment},
            )
        except Exception as error:
            reason = " ".join(str(error).split())
            raise SetupError(
                f"The Ray cluster at '{address}' does not answer: {reason[:300]} If it runs, RAY_AUTH_MODE and the "
                "token (~/.ray/auth_token, or RAY_AUTH_TOKEN) must be those of the cluster."
            ) from error
        resources = ray.cluster_resources()
        gpu = gpu and resources.get("GPU", 0) >= 1
        # --- How many tasks may run at once ---
        capacity = int(resources.get("GPU" if gpu else "CPU", 1))
        self._limit = max(1, min(workers or capacity, capacity))
        self._task = ray.remote(num_cpus=1, num_gpus=1 if gpu else 0, max_retries=0)(_run)
        self._running: dict[Any, Hashable] = {}

    def free(self) -> int:
        """Tasks that may be added: only as many as can run are handed out, so that a million photos need no memory."""
        return self._limit - len(self._running)

    def begin(self, key: Hashable, task: Callable[..., Any], arguments: dict[str, Any]) -> None:
        """Start a task."""
        self._running[self._task.remote(pickle.dumps((task, arguments)))] = key

    def wait(self, seconds: float) -> list[tuple[Any, Message]]:
        """Results of tasks that have ended."""
        if not self._running:
            return []
        ended, _ = self._ray.wait(list(self._running), num_returns=1, timeout=seconds)
        messages = []
        for reference in ended:
            key = self._running.pop(reference)
            try:
                message = Message(*self._ray.get(reference))
            except (self._ray.exceptions.RayError, OSError) as error:
                reason = f"Its worker on the cluster was lost ({type(error).__name__})."
                facts = {"error": "WorkerLost", "reason": reason, "bug": False, "trace": None}
                message = Message(LOST, {**facts, "out_of_memory": False})
            messages.append((key, message))
        return messages

    def close(self) -> None:
        """End the tasks that run, and leave the cluster."""
        for reference in self._running:
            self._ray.cancel(reference, force=True)
        self._running.clear()
        self._ray.shutdown()


def _run(task: bytes) -> tuple[str, Any]:
    """The Ray task. It raises nothing, because the exception's class might not be known elsewhere."""
    return run_task(task, Reporter(lambda kind, facts: None))


def _check_reachable(address: str) -> None:
    """Raise SetupError where nobody listens at HOST:PORT: Ray itself would try for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return
    try:
        socket.create_connection((host.strip("[]"), int(port)), timeout=10).close()
    except (OSError, OverflowError) as error:
        raise SetupError(f"The Ray cluster at '{address}' does not answer: {error}.") from error
