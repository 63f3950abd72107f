"""The websocket: it tells a page how far its jobs are, and when to ask for what it shows."""

import asyncio
import time
from contextlib import suppress
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from materialist.darkroom.desk import Desk, Desks
from materialist.darkroom.endpoint import person_of
from materialist.errors import InputError
from materialist.studio import SETTINGS

LOOK = 0.1
"""Seconds between two looks at what may have changed."""
BEAT = 10.0
"""Seconds after which something is sent in any case: a proxy closes what is silent."""


async def channel(desks: Desks, socket: WebSocket) -> None:
    """Send what changes until the page is closed. The page says nothing here; its requests are requests."""
    try:
        desk = desks.of(socket.query_params.get("page"), person_of(desks.studio, socket))
    except InputError:
        await socket.close(1008)
        return
    if desk.channels >= SETTINGS.channels:
        await socket.close(1013)
        return
    desk.channels += 1
    try:
        await socket.accept()
        await _serve(desk, socket)
    finally:
        desk.channels -= 1


async def _serve(desk: Desk, socket: WebSocket) -> None:
    heard = asyncio.create_task(_until_closed(socket))
    try:
        with desk.page.at_work():
            await _tell(desk, socket, heard)
    except (WebSocketDisconnect, RuntimeError):
        pass  # the page went while something was being sent
    finally:
        heard.cancel()
        with suppress(RuntimeError, WebSocketDisconnect):  # it may be closed already
            await socket.close()


async def _until_closed(socket: WebSocket) -> None:
    with suppress(WebSocketDisconnect, KeyError):
        while True:
            await socket.receive_text()


async def _tell(desk: Desk, socket: WebSocket, heard: "asyncio.Task[None]") -> None:
    last: dict[str, Any] = {}
    said = 0.0
    while not heard.done() and not desk.page.left:
        now = time.monotonic()
        current = news(desk)
        if current != last or now - said > BEAT:
            await socket.send_json(current)
            last = current
            said = now
        await asyncio.wait([heard], timeout=LOOK)


def news(desk: Desk) -> dict[str, Any]:
    """What a page is told unasked."""
    session = desk.session
    live = session.live
    glass = session.glass
    state = None if glass is None else glass.state
    return {
        "revision": desk.revision,
        "ready": live is not None and live.ready,
        "fine": live is not None and live.fine,
        "jobs": desk.shown_jobs(),
        "glass": state
        and {
            "waiting": state.waiting,
            "words": session.without_folders(state.words),
            "bad": state.bad,
        },
    }
