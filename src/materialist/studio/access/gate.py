"""The gate of the studio: which requests reach the page, whose they are, and what a browser may do with the answers."""

import asyncio
import base64
import hashlib
import hmac
import re
import secrets
import time
from collections import deque
from collections.abc import Awaitable, Callable
from functools import cache
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response

from materialist.errors import InputError
from materialist.studio import SETTINGS, asset
from materialist.studio.access.quota import sender_of
from materialist.studio.studio import PERSON, PERSON_HEADER, Studio

Application = Callable[[Any, Any, Any], Awaitable[None]]
LOCAL = ("localhost", "127.0.0.1", "::1")
CHANNEL = "/api/channel"
"""The websocket."""
UPLOAD = "/api/upload"
"""The one place that takes bodies as large as an upload."""
PAGE_HEADER = "x-materialist-page"
"""The name of a page. No form and no foreign page can send a header of that name without being asked first."""
_READ = re.compile(r"/|/favicon\.svg|/assets/[\w.-]+|/api/[\w./-]+")
_PLACES = {"GET": _READ, "HEAD": _READ, "POST": re.compile(r"/api/[\w-]+")}
"""Method -> what the page asks for."""
_FORM_BYTES = 4096
FOREIGN = ("cross-site", "same-site")
"""What a browser says of a request that a page of another place began."""


@cache
def policy() -> str:
    """What a browser may load: scripts, styles and connections of this server alone, and the style of the form."""
    style = re.search(r"<style>(.*?)</style>", asset("login.html"), re.DOTALL)
    digest = base64.b64encode(hashlib.sha256(style[1].encode() if style else b"").digest())
    return (
        "default-src 'none'; script-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
        f"style-src 'self' 'sha256-{digest.decode()}'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
    )


HEADERS = {
    "x-content-type-options": "nosniff",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "same-origin",
}
"""Of every answer, beside the policy."""


class Gate:
    """ASGI application before the page.

    It refuses what the page never asks for, and what pages of other sites ask. A browser sends `Origin` with what a
    page asks of another place; it must be the place that is asked. Where the studio serves this machine only, that
    place must have one of its names, too: a site that lets its own name point to 127.0.0.1 (DNS rebinding) is of the
    same origin, but not of ours. Behind a proxy it must be the proxy's. With a password nothing but the form for it is
    shown before it was given. A change must name its page in a header; a websocket must name its origin.
    """

    def __init__(
        self,
        app: Application,
        studio: Studio,
        *,
        host: str | None = None,
        proxy: str | None = None,
        password: str | None = None,
        port: int = 0,
    ) -> None:
        """host: what a studio for this machine only is bound to. proxy: HOST[:PORT] of the proxy before the studio."""
        self.app = app
        self.studio = studio
        host_names = None if host is None else {*LOCAL, host.lower().strip("[]")}
        self.names = host_names if proxy is None else {_place(f"http://{proxy}")[0]}
        """Host names that may be asked for; None for all."""
        self.proxy = proxy
        self.password = password
        self._cookie = f"materialist_login_{port}"
        self._logins: dict[str, str] = {}
        """Login -> the cookie of the person who logged in: no other cookie counts for it."""
        self._wrong: dict[str, deque[float]] = {}
        """Address -> when the last wrong passwords came from it."""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        if scope["type"] != "http":
            if self._admits_socket(scope):
                return await self.app(scope, receive, send)
            return await send({"type": "websocket.close", "code": 1008})
        # --- Headers that count, and as many bytes as the place may take, in time ---
        address = self._address(scope)
        scope["headers"] = self._heard(scope["headers"])
        max_bytes = _FORM_BYTES if scope["path"] == "/login" else SETTINGS.request_bytes
        seconds: float | None = SETTINGS.request_seconds
        if scope["path"] == UPLOAD:
            max_bytes = largest_upload()
            seconds = None  # it has a limit for each of its parts
        request = Request(scope, _limited(receive, max_bytes, seconds))
        # --- Who answers: the page, the form for passwords, or a refusal ---
        cookies: dict[str, str] = {}
        app = await self._answer(request, cookies, address)

        async def answer(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update({"content-security-policy": policy(), **HEADERS})
                for name, value in cookies.items():
                    secure = (
                        "; Secure"
                        if self.proxy and request.headers["x-forwarded-proto"] == "https"
                        else ""
                    )
                    kept = f"; Max-Age={SETTINGS.person_seconds}" if name == PERSON else ""
                    headers.append(
                        "set-cookie",
                        f"{name}={value}; Path=/; HttpOnly; SameSite=Lax{kept}{secure}",
                    )
            await send(message)

        await app(scope, request.receive, answer)

    def _address(self, scope: Any) -> str:
        """The IP address that a request comes from: behind a proxy what the proxy says, its last word."""
        if self.proxy:
            # The last entry is the proxy's own; those before it are what the client claims.
            forwarded = dict(scope["headers"]).get(b"x-forwarded-for", b"").decode("latin-1")
            return forwarded.rpartition(",")[2].strip() or "proxy"
        return scope["client"][0] if scope.get("client") else "unknown"

    def allows(self, headers: dict[bytes, bytes]) -> bool:
        """Whether a request with these headers (names in lower case) is one of the studio's own pages."""
        values = {name.decode(): value.decode("latin-1").lower() for name, value in headers.items()}
        # --- The place that is asked, and the place that the page is from ---
        asked = (
            values.get("x-forwarded-host", values.get("host", ""))
            if self.proxy
            else values.get("host", "")
        )
        origin = values.get("origin", "")
        place = _place(f"{origin.partition('://')[0] or 'http'}://{asked}")
        # DNS rebinding: a foreign name that points to this machine.
        if self.names is not None and place[0] not in self.names:
            return False
        if values.get("sec-fetch-site") in FOREIGN and values.get("sec-fetch-mode") != "navigate":
            return False
        return not origin or (_place(origin) == place and "" not in place)

    def _heard(self, headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
        """The headers that count: those of a proxy only where there is one, whose name then is the page's own."""
        values = dict(headers)
        if self.proxy and b"x-forwarded-host" not in values:
            values[b"x-forwarded-host"] = values.get(b"host", b"")
        dropped = (b"forwarded", PERSON_HEADER.encode())
        # Only the proxy may say where a request comes from; the person's header is ours alone.
        kept = [(k, v) for k, v in headers if not k.startswith(b"x-forwarded") and k not in dropped]
        if self.proxy:
            scheme = b"http" if values.get(b"x-forwarded-proto") == b"http" else b"https"
            kept += [
                (b"x-forwarded-host", values[b"x-forwarded-host"]),
                (b"x-forwarded-proto", scheme),
            ]
        return kept

    async def _answer(self, request: Request, cookies: dict[str, str], address: str) -> Any:
        """The application that answers: the page, or a refusal; with cookies to set."""
        headers = request.headers
        # A link of another site leads to the page, to nothing else.
        led = headers.get("sec-fetch-site") in FOREIGN and request.url.path != "/"
        if led or not self.allows(dict(request.scope["headers"])):
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        # --- Who asks ---
        login = request.cookies.get(self._cookie, "")
        if self.password and login not in self._logins:
            if (request.method, request.url.path) == ("POST", "/login"):
                return await self._log_in(request, cookies, address)
            return self._form(401)
        person = self._person(request, cookies, login)
        self.studio.note_sender(person, address)
        request.scope["headers"].append((PERSON_HEADER.encode(), person.encode()))
        # --- Only what the page itself asks for ---
        places = _PLACES.get(request.method)
        if places is None or not places.fullmatch(request.scope["path"]):
            return PlainTextResponse("The studio has no such place.\n", 404)
        if request.method == "POST" and PAGE_HEADER not in request.headers:
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        return self.app

    def _admits_socket(self, scope: Any) -> bool:
        """Whether a websocket is of a page of ours, whose browser is known; its person goes into a header."""
        address = self._address(scope)
        scope["headers"] = self._heard(scope["headers"])
        headers = dict(scope["headers"])
        # A browser always names the origin of a websocket; nobody else has anything to do here.
        if scope["path"] != CHANNEL or b"origin" not in headers or not self.allows(headers):
            return False
        cookies = Request({**scope, "type": "http"}).cookies
        login = cookies.get(self._cookie, "")
        if self.password and login not in self._logins:
            return False
        # Only a person who has a cookie already: none is set on a websocket.
        try:
            token = self._logins[login] if self.password else cookies.get(PERSON)
            person = self.studio.person(token)
        except InputError:
            return False
        self.studio.note_sender(person, address)
        scope["headers"].append((PERSON_HEADER.encode(), person.encode()))
        return True

    def _person(self, request: Request, cookies: dict[str, str], login: str) -> str:
        """Whose request it is: the person of its login where there are logins, else the person of its cookie."""
        token = self._logins[login] if self.password else request.cookies.get(PERSON)
        try:
            return self.studio.person(token)
        except InputError:  # its browser is new here
            # A secret that nobody can guess: it alone tells whose photos these are.
            cookies[PERSON] = token = secrets.token_hex(16)
            if self.password:
                self._logins[login] = token
            return self.studio.person(token)

    async def _log_in(self, request: Request, cookies: dict[str, str], address: str) -> Response:
        """The page where the password is right, else the form again.

        After too many wrong ones from an address whatever comes from it.
        """
        try:
            body = await request.body()
        except HTTPException as error:
            return self._form(error.status_code, "That is too long, or too slow, for a password.")
        now = time.monotonic()
        wrong = self._wrong_from(sender_of(address), now)
        if len(wrong) >= SETTINGS.wrong_passwords:
            return self._form(429, "Too many wrong passwords; wait a minute.")
        # Compared in constant time: the time must not tell how much is right.
        word = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
        if not hmac.compare_digest(word.encode(), str(self.password).encode()):
            wrong.append(now)
            return self._form(401, "That is not the password.")
        cookies[self._cookie] = token = secrets.token_urlsafe(24)
        self._logins[token] = request.cookies.get(PERSON, "")
        return RedirectResponse("/", 303)

    def _wrong_from(self, sender: str, now: float) -> deque[float]:
        """When wrong passwords came from a sender within the last minute; old senders are forgotten."""
        wrong = self._wrong.pop(sender, deque())
        # Within the last minute.
        while wrong and now - wrong[0] > 60:
            wrong.popleft()
        self._wrong[sender] = wrong
        # Bounded: addresses cost an attacker little.
        while len(self._wrong) > SETTINGS.addresses:
            self._wrong.pop(next(iter(self._wrong)))
        return wrong

    def _form(self, status: int, message: str = "") -> Response:
        return HTMLResponse(asset("login.html").replace("MESSAGE", message), status)


def largest_upload() -> int:
    """Bytes of the largest body of an upload: of a file, with some room."""
    return int(SETTINGS.upload_megabytes * 1e6) + SETTINGS.request_bytes


def promised_size(request: Request) -> int:
    """The length that an upload gives. Raises InputError for none, another way of saying it, and too much."""
    size = request.headers.get("content-length", "")
    if not re.fullmatch("[0-9]{1,15}", size) or "transfer-encoding" in request.headers:
        raise InputError("An upload must say how long it is.")
    if int(size) > largest_upload():
        raise InputError(f"An upload may have up to {SETTINGS.upload_megabytes} MB.")
    return int(size)


def _limited(receive: Any, max_bytes: int, seconds: float | None) -> Any:
    """`receive` that raises an HTTPException for a body of more bytes, promised or not, or of more seconds."""
    got = 0
    end = None if seconds is None else asyncio.get_running_loop().time() + seconds

    async def counted() -> Any:
        nonlocal got, end
        try:
            async with asyncio.timeout_at(end):
                message = await receive()
        except TimeoutError as error:
            words = f"The request did not arrive within {seconds:g} seconds; send it again."
            raise HTTPException(408, words) from error
        got += len(message.get("body", b""))
        if got > max_bytes:
            raise HTTPException(413, f"More than {max_bytes / 1e6:g} MB is not taken here.")
        if not message.get("more_body", False):
            end = None  # what follows is the end of the connection
        return message

    return counted


def _place(address: str) -> tuple[str, int | None]:
    """(host, port) of an address, the usual port of its scheme where it names none; an empty host where it has none."""
    try:
        parts = urlsplit(address)
        return parts.hostname or "", parts.port or {"http": 80, "https": 443}.get(parts.scheme)
    except ValueError:
        return "", None
