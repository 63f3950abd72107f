"""Processes of the studio: told what to do on stdin, telling JSON lines on stdout, ended with all that they started."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from typing import Any


def start(module: str) -> subprocess.Popen[str]:
    """Run a module in a process of its own. Raises OSError where none can be started."""
    return subprocess.Popen(
        [sys.executable, "-m", module], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=None, text=True,
        start_new_session=True,
    )  # fmt: skip


def ask(process: subprocess.Popen[str], what: dict[str, Any]) -> None:
    """Write one JSON line to it; nothing happens where it has ended.

    The pipe stays open: a worker ends itself when the studio is gone and it breaks.
    """
    assert process.stdin is not None
    with contextlib.suppress(BrokenPipeError, ValueError):
        process.stdin.write(json.dumps(what, default=str) + "\n")
        process.stdin.flush()


def lines(process: subprocess.Popen[str]) -> Iterator[dict[str, Any]]:
    """What the worker says, one JSON object a line; anything else on its stdout is not for us."""
    assert process.stdout is not None
    for line in process.stdout:
        with contextlib.suppress(ValueError):
            entry = json.loads(line)
            if isinstance(entry, dict):
                yield entry


def kill(process: subprocess.Popen[str]) -> None:
    """End it and what it started, at once."""
    with contextlib.suppress(ProcessLookupError, PermissionError):
        os.killpg(process.pid, signal.SIGKILL)


def close(process: subprocess.Popen[str]) -> None:
    """Close its pipes, end it where it still runs, and wait."""
    for stream in (process.stdin, process.stdout):
        if stream is not None:
            with contextlib.suppress(OSError):
                stream.close()
    if process.poll() is None:
        kill(process)
        process.wait()
