"""The starting side of a worker process: it sends tasks and receives messages, the last one about the process's end."""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import wait
from typing import IO, Any

LOST = "lost"
"""Kind of the last message: the process has ended. Its facts are those of `exit_report`."""


@dataclass(frozen=True)
class Message:
    kind: str
    """A kind of `worker`, or LOST."""
    facts: Any
    number: int = 0
    """The task that it is about, as `Worker.begin` gave it."""


class Worker:
    """A process of its own, in a session of its own: Ctrl-C does not reach it."""

    def __init__(
        self,
        *,
        environment: Mapping[str, str] | None = None,
        niceness: int = 0,
        idle: float = 0.0,
        memory: int = 0,
        threads: int = 0,
        keep_errors: bool = False,
    ) -> None:
        """Start it. Raises OSError where no process can be started.

        environment: variables that differ from this process's. niceness: added to this process's. idle: seconds
        without a task after which it ends by itself; 0: never. memory: bytes of data that it may hold; 0: no limit.
        threads: tasks that it does at a time, all that it gets; 0: one, the newest of those that wait.
        keep_errors: keep its stderr for the report of its end.
        """
        # A file, not a pipe: a pipe that nobody reads stops the process once it is full.
        self._errors = tempfile.TemporaryFile() if keep_errors else None  # noqa: SIM115 - read at its end
        self.connection, theirs = Pipe()
        # The worker gets its end of the pipe as a file descriptor.
        words = [sys.executable, "-m", "materialist.jobs.worker", str(theirs.fileno())]
        words += [str(niceness), str(idle), str(memory), str(threads)]
        try:
            # A new program, not a fork: a renderer that has started does not survive one.
            self._process = subprocess.Popen(
                words,
                stdin=subprocess.DEVNULL,
                stderr=self._errors,
                env={**os.environ, **(environment or {})},
                pass_fds=(theirs.fileno(),),
                start_new_session=True,
            )
        except OSError:
            self.connection.close()
            raise
        finally:
            theirs.close()
        self._number = 0

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def begin(self, task: Callable[..., Any], arguments: dict[str, Any]) -> int:
        """Send a task, which without threads replaces those that wait in the process; returns its number."""
        self._number += 1
        with contextlib.suppress(OSError):  # the process has ended: LOST says so
            self.connection.send((self._number, pickle.dumps((task, arguments))))
        return self._number

    def receive(self) -> list[Message]:
        """The messages that are there now. After LOST there is nothing more, and the process is gone."""
        messages = []
        try:
            while self.connection.poll():
                messages.append(Message(*self.connection.recv()))
        except (EOFError, OSError):
            messages.append(Message(LOST, exit_report(self.close(), self._errors), self._number))
        return messages

    def messages(self) -> Iterator[Message]:
        """Messages as they come, the last one LOST."""
        while True:
            wait([self.connection])
            for message in self.receive():
                yield message
                if message.kind == LOST:
                    return

    def kill(self) -> None:
        """End it and what it started at once; the next message is LOST."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            if self.running:
                # The whole session: what the task started ends with it.
                os.killpg(self.pid, signal.SIGKILL)

    def close(self) -> int:
        """End it, and wait for that; returns its exit code, below zero for a signal."""
        if self.connection.closed:
            return self._process.wait()
        self.connection.close()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(0.5)  # one that is ending by itself keeps its exit code
        self.kill()
        return self._process.wait()


def exit_report(code: int, errors: IO[bytes] | None = None) -> dict[str, Any]:
    """Why a process ended, from its exit code and its last line of stderr; keys as of `worker.failure_facts`."""
    # A negative code is the number of the signal that ended it.
    if code < 0:
        name = signal.Signals(-code).name if -code in set(signal.Signals) else str(-code)
        hint = " (as the system does when memory runs out)" if -code == signal.SIGKILL else ""
        reason = f"The worker process was ended by {name}{hint}."
    else:
        reason = f"The worker process ended with exit code {code}."
    if errors is not None:
        # The last two thousand bytes hold the last line.
        size = errors.seek(0, os.SEEK_END)
        errors.seek(max(0, size - 2000))
        lines = errors.read().decode("utf-8", "replace").strip().splitlines()
        reason += f" Its last words: {lines[-1][:300]}" if lines else ""
    out_of_memory = code == -signal.SIGKILL
    return {
        "error": "WorkerLost",
        "reason": reason,
        "bug": False,
        "trace": None,
        "out_of_memory": out_of_memory,
    }


def sentence(facts: dict[str, Any]) -> str:
    """The reason of a failure as a sentence for a page; the trace of a bug goes to the terminal."""
    if not facts["bug"]:
        return str(facts["reason"])
    sys.stderr.write(facts["trace"])
    return f"Something went wrong inside ({facts['error']}: {facts['reason']}); the terminal has the details."
