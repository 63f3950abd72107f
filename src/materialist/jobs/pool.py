"""Several worker processes of this machine, each with one task at a time."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import IO, Any, Protocol

from materialist.errors import SetupError
from materialist.jobs.process import LOST, Message, Worker
from materialist.jobs.worker import DONE, FAILED


class Pool(Protocol):
    """Workers, of whatever kind."""

    def free(self) -> int:
        """How many tasks may be begun now."""
        ...

    def begin(self, key: Hashable, task: Callable[..., Any], arguments: dict[str, Any]) -> None:
        """Hand a task to a free worker."""
        ...

    def wait(self, seconds: float) -> list[tuple[Any, Message]]:
        """(key of the task, message): as soon as there is one, and none after `seconds`."""
        ...

    def close(self) -> None:
        """End all workers, also those at work."""
        ...


@dataclass
class _Place:
    """A place for one worker."""

    environment: Mapping[str, str]
    worker: Worker | None = None
    errors: IO[bytes] | None = None
    key: Hashable | None = None


class LocalPool:
    """One worker process for each environment; started when it is first needed, and again after it died."""

    def __init__(self, environments: list[dict[str, str]]) -> None:
        """`environments`: environment variables of each worker that differ from those of this process."""
        self._places = [_Place(environment) for environment in environments]
        self._proven = False

    def free(self) -> int:
        """Workers without a task."""
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
        """Messages of the workers. Raises SetupError when none can start at all."""
        begun = {place.worker.connection: place for place in self._places if place.worker is not None}
        found = []
        for connection in wait(list(begun), seconds):
            place = begun[connection]  # type: ignore[index]
            assert place.worker is not None
            for message in place.worker.receive():
                if place.key is not None:
                    found.append((place.key, message))
                if message.kind in (DONE, FAILED):
                    self._proven, place.key = True, None
                elif message.kind == LOST:
                    self._forget(place)
                    if message.facts["unready"] and not self._proven:
                        raise SetupError(f"A worker process does not start: {message.facts['reason']}")
        return found

    def close(self) -> None:
        """End all workers."""
        for place in self._places:
            if place.worker is not None:
                place.worker.kill()
        for place in self._places:
            if place.worker is not None:
                place.worker.close()
            self._forget(place)

    def _forget(self, place: _Place) -> None:
        if place.errors is not None:
            place.errors.close()
        place.worker = place.errors = place.key = None
