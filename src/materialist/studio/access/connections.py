"""Connections that ask for nothing: they are closed after a while, and one address has only so many."""

from collections import Counter
from typing import Any

from uvicorn.protocols.http.h11_impl import H11Protocol

from materialist.studio import SETTINGS
from materialist.studio.access.quota import sender_of


class Connection(H11Protocol):
    """A connection that must ask for something soon; uvicorn itself waits for ever for the end of its headers."""

    counted = True
    """Whether addresses count: not behind a proxy, from where all come."""
    _open: Counter[str] = Counter()
    """Address -> its connections. All are of one loop, so nothing locks it."""
    _sender: str | None = None
    _silence: Any = None

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        peer = transport.get_extra_info("peername") or ("unknown",)
        self._sender = sender = sender_of(str(peer[0]))
        self._open[sender] += 1
        if self.counted and self._open[sender] > SETTINGS.connections:
            transport.close()
            return
        self._look(None)

    def _look(self, last: Any) -> None:
        """Close where no request has begun since the look before, whose last one was `last`."""
        at_work = self.cycle is not None and not self.cycle.response_complete
        if self._silence is not None and self.cycle is last and not at_work:
            self.transport.close()
            return
        # One that sends its headers letter by letter is silent, too: the request has not begun.
        self._silence = self.loop.call_later(SETTINGS.request_seconds, self._look, self.cycle)

    def handle_websocket_upgrade(self, event: Any) -> None:
        # What follows is another protocol's, which does not tell this one of its end.
        self._forget()
        super().handle_websocket_upgrade(event)

    def connection_lost(self, exc: Exception | None) -> None:
        self._forget()
        super().connection_lost(exc)

    def _forget(self) -> None:
        if self._silence is not None:
            self._silence.cancel()
        if self._sender is not None:
            self._open[self._sender] -= 1
            # A counter keeps zeros: strangers would fill it.
            if not self._open[self._sender]:
                del self._open[self._sender]
            self._sender = None


class ProxiedConnection(Connection):
    counted = False
