"""The process that does one piece of long work for the studio: reads what to do from stdin, tells JSON lines on stdout.

`{"stage", "done", "total"}` while it works, `{"found", "file"}` for a picture on the way, then `{"result": {...}}` or
`{"error": "one sentence"}`. It ends itself when its stdin breaks, that is when the studio is gone.
"""

from __future__ import annotations

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from materialist.errors import MaterialistError

NICE = 5
"""Live previews of others go before."""


def main() -> None:
    """Do the one job that stdin describes."""
    tell = teller()
    spec = json.loads(sys.stdin.readline())
    threading.Thread(target=_until_alone, daemon=True).start()
    os.nice(NICE)
    from materialist.studio import tasks

    try:
        tell({"result": tasks.do(Reporter(tell), **spec)})
    except Exception as error:
        tell({"error": sentence(error)})
    # Without the interpreter's own goodbye: libraries with threads take seconds over it.
    sys.stderr.flush()
    os._exit(0)


class Reporter:
    """What a task tells while it works: call it as progress(stage, done, total)."""

    def __init__(self, tell: Callable[[dict[str, Any]], None]):
        self._tell, self._last = tell, ("", 0.0)

    def __call__(self, stage: str, done: int, total: int) -> None:
        now = time.monotonic()
        if stage != self._last[0] or now - self._last[1] > 0.1 or done >= total:
            self._last = (stage, now)
            self._tell({"stage": stage, "done": int(done), "total": int(total)})

    def found(self, name: str, file: Path) -> None:
        """A picture for the page."""
        self._tell({"found": name, "file": file.name})


def teller() -> Callable[[dict[str, Any]], None]:
    """What writes one JSON line to stdout, which nothing else reaches from then on."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)  # whatever libraries say goes to stderr

    def tell(entry: dict[str, Any]) -> None:
        out.write(json.dumps(entry, default=str) + "\n")
        out.flush()

    return tell


def sentence(error: Exception) -> str:
    """What went wrong, for the page; what we did not expect goes to the terminal as well."""
    if isinstance(error, MaterialistError):
        return str(error)
    if isinstance(error, MemoryError):
        return "There is not enough memory for this; try a smaller size."
    import traceback

    traceback.print_exception(error)
    return f"Something went wrong inside ({type(error).__name__}: {error}); the terminal has the details."


def _until_alone() -> None:
    while sys.stdin.readline():
        pass
    os._exit(3)


if __name__ == "__main__":
    main()
