"""Several worker processes of this machine, each with one task at a time. `ray_pool` has the same methods."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import IO, Any

from materialist.jobs.process import LOST, Message, Worker
from materialist.jobs.worker import DONE, FAILED


@dataclass
class _Place:
    """A place for one worker."""

    environment: Mapping[str, str]
    worker: Worker | None = None
    errors: IO[bytes] | None = None
    key: Hashable | None = None

    def clear(self) -> None:
        if self.errors is not None:
            self.errors.close()
        self.worker = self.errors = self.key = None


class LocalPool:
    """One worker process for each environment; started when it is first needed, and again after it died."""

    def __init__(self, environments: list[dict[str, str]]) -> None:
        """`environments`: environment variables of each worker that differ from those of this process."""
        self._places = [_Place(environment) for environment in environments]

    def free(self) -> int:
        """How many tasks may be begun now."""
        return sum(place.key is None for place in self._places)

    def begin(self, key: Hashable, task: Callable[..., Any], arguments: dict[str, Any]) -> None:
        """Hand a task to a free worker."""
        place = next(place for place in self._places if place.key is None)
        if place.worker is None:
            place.errors = tempfile.TemporaryFile()  # noqa: SIM115 - read when the process has died
            place.worker = Worker(environment=place.environment, errors=place.errors)
        place.key = key
        place.worker.begin(task, arguments)

    def wait(self, seconds: float) -> list[tuple[Any, Message]]:
        """(key of the task, message): as soon as there is one, and none after `seconds`."""
        begun = {place.worker.connection: place for place in self._places if place.worker is not None}
        found = []
        for connection in wait(list(begun), seconds):
            place = begun[connection]  # type: ignore[index]
            assert place.worker is not None
            for message in place.worker.receive():
                if place.key is not None:
                    found.append((place.key, message))
                if message.kind in (DONE, FAILED):
                    place.key = None
                elif message.kind == LOST:
                    place.clear()
        return found

    def close(self) -> None:
        """End all workers, also those at work."""
        workers = [place.worker for place in self._places if place.worker is not None]
        for worker in workers:
            worker.kill()
        for worker in workers:
            worker.close()
        for place in self._places:
            place.clear()
