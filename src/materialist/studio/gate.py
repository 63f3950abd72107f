"""The gate of the studio: which requests reach the page, whose they are, and what a browser may do with the answers."""

import hmac
import re
import secrets
import time
from collections import deque
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

from starlette.datastructures import MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import HTMLResponse, PlainTextResponse, RedirectResponse, Response

from materialist.errors import InputError
from materialist.studio import SETTINGS, asset
from materialist.studio.studio import PERSON, Studio

Application = Callable[[Any, Any, Any], Awaitable[None]]
LOCAL = ("localhost", "127.0.0.1", "::1")
_API = "/gradio_api/"
_BEAT = f"{_API}heartbeat/"
"""A page holds a request to this place, and its name, as long as it is open."""
_UPLOAD, _FILE = f"{_API}upload", f"{_API}file="
_READ = re.compile(
    rf"/|/(config|theme\.css|favicon\.ico|robots\.txt)|/(assets|static)/.+|{_FILE}[^\0]+|{_BEAT}\w+"
    rf"|{_API}(queue/data|upload_progress|app_id)"
)
_PLACES = {"GET": _READ, "HEAD": _READ, "POST": re.compile(rf"{_API}(queue/join|run/predict|upload)")}
"""Method -> what the page asks for. Gradio has more: places that fetch from other machines, record and write."""
_FORM_BYTES = 4096
HEADERS = {
    # Gradio makes functions of texts and styles of its own; whatever they do, it stays between page and studio.
    "content-security-policy": (
        "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; media-src 'self' data: blob:; font-src 'self' data:; worker-src 'self' blob:; "
        "connect-src 'self' data: blob:; object-src 'none'; base-uri 'self'; form-action 'self'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",
    "referrer-policy": "same-origin",
}
"""Of every answer."""


class Gate:
    """ASGI application before the page.

    It refuses what the page never asks for, and what pages of other sites ask. A browser sends `Origin` with what a
    page asks of another place; it must be the place that is asked. Where the studio serves this machine only, that
    place must have one of its names, too: a site that lets its own name point to 127.0.0.1 (DNS rebinding) is of the
    same origin, but not of ours. Behind a proxy it must be the proxy's. With a password nothing but the form for it is
    shown before it was given. The name of a page (Gradio's session hash) belongs to the browser that used it first.
    """

    def __init__(
        self, app: Application, studio: Studio, *, host: str | None = None, proxy: str | None = None,
        password: str | None = None, port: int = 0,
    ) -> None:  # fmt: skip
        """host: what a studio for this machine only is bound to. proxy: HOST[:PORT] of the proxy before the studio."""
        self.app, self.studio = app, studio
        own = None if host is None else {*LOCAL, host.lower().strip("[]")}
        self.names = own if proxy is None else {_place(f"http://{proxy}")[0]}
        """Host names that may be asked for; None for all."""
        self.proxy, self.password = proxy, password
        self._cookie = f"materialist_login_{port}"
        self._logins: set[str] = set()
        self._wrong: deque[float] = deque()
        """When the last wrong passwords came."""

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "lifespan":
            return await self.app(scope, receive, send)
        if scope["type"] != "http":
            return await send({"type": "websocket.close", "code": 1008})
        scope["headers"] = self._heard(scope["headers"])
        upload = int(SETTINGS.upload_megabytes * 1e6) if scope["path"] == _UPLOAD else 0
        most = _FORM_BYTES if scope["path"] == "/login" else SETTINGS.request_bytes + upload
        request = Request(scope, _limited(receive, most))
        cookies: dict[str, str] = {}
        app = await self._answer(request, cookies)

        async def answer(message: Any) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                headers.update(HEADERS)
                for name, value in cookies.items():
                    secure = "; Secure" if self.proxy and request.headers["x-forwarded-proto"] == "https" else ""
                    kept = f"; Max-Age={SETTINGS.person_seconds}" if name == PERSON else ""
                    headers.append("set-cookie", f"{name}={value}; Path=/; HttpOnly; SameSite=Lax{kept}{secure}")
            await send(message)

        await app(scope, request.receive, answer)

    def allows(self, headers: dict[bytes, bytes]) -> bool:
        """Whether a request with these headers (names in lower case) is one of the studio's own pages."""
        told = {name.decode(): value.decode("latin-1").lower() for name, value in headers.items()}
        asked = told.get("x-forwarded-host", told.get("host", "")) if self.proxy else told.get("host", "")
        origin = told.get("origin", "")
        place = _place(f"{origin.partition('://')[0] or 'http'}://{asked}")
        if self.names is not None and place[0] not in self.names:
            return False
        if told.get("sec-fetch-site") in ("cross-site", "same-site") and told.get("sec-fetch-mode") != "navigate":
            return False
        return not origin or (_place(origin) == place and "" not in place)

    def _heard(self, headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
        """The headers that count: those of a proxy only where there is one, whose name then is the page's own."""
        told = dict(headers)
        if self.proxy and b"x-forwarded-host" not in told:
            told[b"x-forwarded-host"] = told.get(b"host", b"")
        kept = [(k, v) for k, v in headers if not k.startswith(b"x-forwarded") and k != b"forwarded"]
        if self.proxy:
            scheme = b"http" if told.get(b"x-forwarded-proto") == b"http" else b"https"
            kept += [(b"x-forwarded-host", told[b"x-forwarded-host"]), (b"x-forwarded-proto", scheme)]
        return kept

    async def _answer(self, request: Request, cookies: dict[str, str]) -> Any:
        """The application that answers: the page, or a refusal; with cookies to set."""
        if not self.allows(dict(request.scope["headers"])):
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        if self.password and request.cookies.get(self._cookie) not in self._logins:
            if (request.method, request.url.path) == ("POST", "/login"):
                return await self._log_in(request, cookies)
            return self._form(401)
        try:
            person = self.studio.person(request.cookies.get(PERSON))
        except InputError:  # its browser is new here
            cookies[PERSON] = person = secrets.token_hex(16)
        path = request.scope["path"]
        if request.method not in _PLACES or not _PLACES[request.method].fullmatch(path):
            return PlainTextResponse("The studio has no such place.\n", 404)
        if path.startswith(_FILE):
            file, cache = (Path(one).resolve() for one in (path.removeprefix(_FILE), self.studio.work.cache))
            if not file.is_relative_to(cache):  # files of ours, and addresses that Gradio would fetch
                return PlainTextResponse("The studio serves no such file.\n", 403)
        try:
            if page := request.query_params.get("session_hash"):
                self.studio.session(page, person)
            if path.startswith(_BEAT) and request.method == "GET":
                self.studio.session(path.removeprefix(_BEAT), person, beats=True)
            if path == _UPLOAD:
                self.studio.note_upload(person, request.headers.get("content-length", ""))
        except InputError as error:
            return PlainTextResponse(f"{error}\n", 403)
        return self.app

    async def _log_in(self, request: Request, cookies: dict[str, str]) -> Response:
        """The page where the password is right, else the form again; after too many wrong ones whatever it is."""
        try:
            body = await request.body()
        except HTTPException:
            return self._form(413, "That is too long for a password.")
        now = time.monotonic()
        while self._wrong and now - self._wrong[0] > 60:
            self._wrong.popleft()
        if len(self._wrong) >= SETTINGS.wrong_passwords:
            return self._form(429, "Too many wrong passwords; wait a minute.")
        word = parse_qs(body.decode("utf-8", "replace")).get("password", [""])[0]
        if not hmac.compare_digest(word.encode(), str(self.password).encode()):
            self._wrong.append(now)
            return self._form(401, "That is not the password.")
        cookies[self._cookie] = token = secrets.token_urlsafe(24)
        self._logins.add(token)
        return RedirectResponse("/", 303)

    def _form(self, status: int, message: str = "") -> Response:
        return HTMLResponse(asset("login.html").replace("MESSAGE", message), status)


def _limited(receive: Any, most: int) -> Any:
    """`receive` that raises an HTTPException, which Gradio answers with, after so many bytes, promised or not."""
    got = 0

    async def counted() -> Any:
        nonlocal got
        message = await receive()
        got += len(message.get("body", b""))
        if got > most:
            raise HTTPException(413, f"More than {most / 1e6:g} MB is not taken here.")
        return message

    return counted


def _place(address: str) -> tuple[str, int | None]:
    """(host, port) of an address, the usual port of its scheme where it names none; an empty host where it has none."""
    try:
        parts = urlsplit(address)
        return parts.hostname or "", parts.port or {"http": 80, "https": 443}.get(parts.scheme)
    except ValueError:
        return "", None
