"""Signals that ask a run of minutes or hours to end with what it has."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


@contextmanager
def stop_requests() -> Iterator[list[int]]:
    """Notes SIGTERM or Ctrl-C in a list, so that a run can end with a checkpoint; the second signal ends it at once.

    Outside of the main thread nothing is noted.
    """
    signals = list[int]()
    before = dict[int, Any]()

    def restore() -> None:
        while before:
            number, handler = before.popitem()
            signal.signal(number, signal.SIG_DFL if handler is None else handler)

    def note(number: int, _: Any) -> None:
        signals.append(number)
        restore()

    if threading.current_thread() is threading.main_thread():
        before.update(
            {number: signal.signal(number, note) for number in (signal.SIGTERM, signal.SIGINT)}
        )
    try:
        yield signals
    finally:
        restore()
