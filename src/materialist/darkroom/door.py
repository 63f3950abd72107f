"""The gate of the darkroom: the studio's, with its own places, a stricter policy, and one websocket."""

import base64
import hashlib
import re
from functools import cache
from typing import Any

from starlette.requests import Request
from starlette.responses import PlainTextResponse

from materialist.errors import InputError
from materialist.studio import asset
from materialist.studio.access.gate import HEADERS, Gate
from materialist.studio.studio import PERSON, PERSON_HEADER

CHANNEL = "/api/channel"
"""The websocket."""
UPLOAD = "/api/upload"
PAGE_HEADER = "x-materialist-page"
"""The name of a page. No form and no foreign page can send a header of that name without being asked first."""
_READ = re.compile(r"/|/favicon\.svg|/assets/[\w.-]+|/api/[\w./-]+")
_WRITE = re.compile(r"/api/[\w-]+")
_PLACES = {"GET": _READ, "HEAD": _READ, "POST": _WRITE}


@cache
def _style_of_login() -> str:
    """The hash of the style in the form for the password, as a policy names it."""
    style = re.search(r"<style>(.*?)</style>", asset("login.html"), re.DOTALL)
    digest = hashlib.sha256(style[1].encode() if style else b"").digest()
    return f"'sha256-{base64.b64encode(digest).decode()}'"


class Door(Gate):
    """The studio's gate before the darkroom: scripts, styles and connections are those of its own server alone."""

    upload_place = UPLOAD
    headers = HEADERS | {
        "content-security-policy": (
            "default-src 'none'; script-src 'self'; img-src 'self' data: blob:; connect-src 'self'; "
            f"style-src 'self' {_style_of_login()}; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
        ),
        "cross-origin-opener-policy": "same-origin",
    }

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] == "websocket" and self._admits_socket(scope):
            return await self.app(scope, receive, send)
        await super().__call__(scope, receive, send)

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
        try:
            token = self._logins[login] if self.password else cookies.get(PERSON)
            person = self.studio.person(token)
        except InputError:
            return False
        self.studio.note_sender(person, address)
        scope["headers"].append((PERSON_HEADER.encode(), person.encode()))
        return True

    async def _admitted(self, request: Request, person: str) -> Any:
        path = request.scope["path"]
        if request.method not in _PLACES or not _PLACES[request.method].fullmatch(path):
            return PlainTextResponse("The studio has no such place.\n", 404)
        if request.method == "POST" and PAGE_HEADER not in request.headers:
            return PlainTextResponse("The studio answers its own pages only.\n", 403)
        return self.app
