"""Who may talk to the studio: pages that it served itself, under names that are this machine's."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any
from urllib.parse import urlsplit

LOCAL = ("localhost", "127.0.0.1", "::1")
"""Names of this machine."""
Application = Callable[[Any, Any, Any], Awaitable[None]]


class Guard:
    """ASGI middleware that refuses requests sent by the pages of other sites.

    A browser sends `Origin` with what a page asks of another place; it must be the place that is asked. Where the
    studio serves this machine only, that place must have one of its names, too: a site that lets its own name point
    to 127.0.0.1 (DNS rebinding) is of the same origin, but not of ours.
    """

    def __init__(self, app: Application, names: tuple[str, ...] | None = None):
        """`names`: host names that may be asked for; None for all."""
        self.app, self.names = app, names

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Pass a request on, or answer 403."""
        if scope["type"] not in ("http", "websocket") or self.welcome(dict(scope["headers"])):
            await self.app(scope, receive, send)
        elif scope["type"] == "websocket":
            await send({"type": "websocket.close", "code": 1008})
        else:
            headers = [(b"content-type", b"text/plain; charset=utf-8")]
            await send({"type": "http.response.start", "status": 403, "headers": headers})
            await send({"type": "http.response.body", "body": b"The studio answers its own pages only.\n"})

    def welcome(self, headers: dict[bytes, bytes]) -> bool:
        """Whether a request with these headers (names in lower case) may pass."""
        host = headers.get(b"host", b"").decode("latin-1").lower()
        if self.names is not None and _name(f"//{host}") not in self.names:
            return False
        origin = headers.get(b"origin", b"").decode("latin-1").lower()
        if not origin:
            return True
        # A proxy before the studio may ask it under another name, and tells the one that it was asked under.
        asked = {host, headers.get(b"x-forwarded-host", b"").decode("latin-1").lower()} - {""}
        scheme, place = origin.partition("://")[0], _place(origin)
        return place is not None and any(place == _place(f"{scheme}://{one}") for one in asked)


def names_of(host: str) -> tuple[str, ...]:
    """Host names of a studio that serves this machine only, bound to `host`."""
    return (*LOCAL, host.lower().strip("[]"))


def _name(address: str) -> str | None:
    try:
        return urlsplit(address).hostname
    except ValueError:
        return None


def _place(address: str) -> tuple[str, int | None] | None:
    """(host, port) of an address, the usual port of its scheme where it names none; None where it has no host."""
    try:
        parts = urlsplit(address)
        port = parts.port or {"http": 80, "https": 443}.get(parts.scheme)
    except ValueError:
        return None
    return (parts.hostname, port) if parts.hostname else None
