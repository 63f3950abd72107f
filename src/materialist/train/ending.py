"""How a run of training is ended before its budget is spent."""

from __future__ import annotations

import signal
import threading
from types import TracebackType
from typing import Any


class Ending:
    """Notes a SIGTERM or Ctrl-C, so that the run can end with a checkpoint; the second one ends it at once.

    Outside the main thread nothing is noted.
    """

    def __init__(self) -> None:
        self.asked = False
        self.interrupted = False
        """Whether it was Ctrl-C."""
        self._before: dict[int, Any] = {}

    def __enter__(self) -> Ending:
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGTERM, signal.SIGINT):
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None):
        self._restore()

    def _restore(self) -> None:
        """Back to what was before."""
        while self._before:
            number, before = self._before.popitem()
            signal.signal(number, signal.SIG_DFL if before is None else before)

    def _note(self, number: int, _: Any) -> None:
        self.asked, self.interrupted = True, number == signal.SIGINT
        self._restore()
