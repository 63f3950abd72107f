"""The worker process: `python -m materialist.batches.worker`, a job a line on stdin, news a line on stdout.

It ends when stdin ends, also in the middle of a photo: a batch that was killed leaves nobody who goes on writing.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
from collections.abc import Callable
from typing import Any

QUIET = 0.2
"""Seconds between two reports of the same stage."""


def main() -> None:
    """Serve until stdin ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole group; the batch ends its workers itself
    # Whatever a library writes to stdout must not get between the lines: they have a descriptor of their own.
    say = _speaker(os.dup(1))
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[str] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    say({"kind": "ready"})
    from materialist.batches.job import Job

    while True:
        _serve(Job.from_text(jobs.get()), say)


def _listen(jobs: queue.SimpleQueue[str]) -> None:
    for line in sys.stdin:
        jobs.put(line)
    os._exit(0)  # nobody listens any more


def _speaker(descriptor: int) -> Callable[[dict[str, Any]], None]:
    def say(message: dict[str, Any]) -> None:
        try:
            line = (json.dumps(message, default=float) + "\n").encode()
            while line:
                line = line[os.write(descriptor, line) :]
        except BrokenPipeError:
            os._exit(0)

    return say


def _serve(job: Any, say: Callable[[dict[str, Any]], None]) -> None:
    """Do one job and say how it went."""
    from materialist.batches.news import describe
    from materialist.batches.work import process

    told, current = 0.0, "read"

    def tick(stage: str, done: int, total: int) -> None:
        nonlocal told, current
        now = time.monotonic()
        if stage == current and now - told < QUIET:
            return
        told, current = now, stage
        say({"kind": "progress", "facts": {"stage": stage, "done": done, "total": total}})

    try:
        facts = process(job, tick)
    except Exception as error:
        say({"kind": "failed", "facts": describe(error, current)})
    else:
        say({"kind": "done", "facts": facts})


if __name__ == "__main__":
    main()
