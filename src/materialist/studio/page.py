"""A page that is open in a browser: which session it shows, and whether it is still there."""

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from materialist.studio.session import Session


@dataclass(eq=False)
class Page:
    """One page. Pages of one person on one photo share a session: what one changes, the others show."""

    person: str
    session: Session
    sender: str = ""
    """The address that it was opened from, by which pages are counted."""
    seen: float = 0.0
    """When it last asked for something, by the monotonic clock."""
    left: bool = False
    """Whether it was closed."""
    desk: Any = None
    """What a server of pages keeps beside it; it goes with the page."""
    _busy: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock, repr=False)

    @property
    def is_open(self) -> bool:
        """Whether a request of it, or its channel, is at work."""
        return self._busy > 0

    @contextmanager
    def at_work(self) -> Iterator[None]:
        """While a request, or the channel, is at work the page is open, however long it takes."""
        with self._lock:
            self._busy += 1
        try:
            yield
        finally:
            with self._lock:
                self._busy -= 1
                self.seen = time.monotonic()
