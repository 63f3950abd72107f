"""The darkroom's server: its places, behind the gate."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.resources import files
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket

from materialist.darkroom import editing, opening, requests, seeing, taking
from materialist.darkroom.channel import channel
from materialist.darkroom.desk import Desk, Desks
from materialist.darkroom.endpoint import Answer, got, guarded, posted
from materialist.darkroom.state import (
    about,
    example_file,
    light_jpeg,
    native_jpeg,
    photo_jpeg,
    state,
    working_jpeg,
)
from materialist.errors import InputError
from materialist.studio import drawn
from materialist.studio.access.gate import CHANNEL, UPLOAD, Gate
from materialist.studio.studio import Studio

SWEEP = 10.0
"""Seconds between two looks for pages that were closed."""
STATIC = Path(str(files("materialist.darkroom") / "static"))
_POSTED: dict[str, tuple[type[requests.RequestBody], Any]] = {
    # Photos.
    "start": (requests.Start, opening.start),
    "open": (requests.Named, opening.open_project),
    "close": (requests.Nothing, opening.close_project),
    "rename": (requests.Renamed, opening.rename),
    "discard": (requests.Named, opening.discard),
    "stop": (requests.Numbered, lambda desk, body: desk.stop(body.number)),
    # Selecting.
    "pick": (requests.Pick, editing.pick),
    "point": (requests.Pointed, editing.point),
    "resize": (requests.Resized, editing.resize),
    "material": (requests.Nothing, editing.keep_material),
    "deselect": (requests.Nothing, editing.deselect),
    "colour": (requests.Pointed, seeing.colour_at),
    # Changing.
    "set": (requests.Options, editing.set_options),
    "use": (requests.File, editing.use_file),
    "light": (requests.Chosen, editing.choose_light),
    "lamp": (requests.NewLamp, editing.add_lamp),
    "lamps": (requests.MovedLamp, editing.set_lamp),
    "object": (requests.Chosen, editing.choose_object),
    "place": (requests.Put, editing.put_object),
    "fall": (requests.Fall, editing.let_fall),
    # The list.
    "act": (requests.Act, editing.act),
    "undo": (requests.Undo, editing.undo),
    "load": (requests.LoadedList, taking.load),
    # Taking away.
    "final": (requests.Nothing, taking.render),
    "take": (requests.Take, taking.take),
}
"""Place under /api -> the body of its requests, and what answers them."""


def application(
    studio: Studio,
    *,
    host: str,
    port: int,
    password: str | None = None,
    proxy: str | None = None,
) -> Gate:
    """The page behind its gate, an ASGI application."""
    studio.work.sweep()
    desks = Desks(studio)
    app = Starlette(routes=_routes(desks), lifespan=_sweeping(studio))
    single = host if studio.single_user else None
    return Gate(app, studio, host=single, proxy=proxy, password=password, port=port)


def _sweeping(studio: Studio) -> Any:
    """A lifespan in which the memory of closed pages is given back."""

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        task = asyncio.create_task(sweep())
        yield
        task.cancel()

    async def sweep() -> None:
        while True:
            await asyncio.sleep(SWEEP)
            await run_in_threadpool(studio.leave_idle)

    return lifespan


def _routes(desks: Desks) -> list[Any]:
    studio = desks.studio

    async def upload(request: Request) -> Response:
        return await opening.receive_upload(desks, request)

    async def socket(connection: WebSocket) -> None:
        await channel(desks, connection)

    # --- Answers that change nothing, by place ---
    read = {
        "/api/about": lambda desk, request: _json(about(studio, desk.person)),
        "/api/arrive": lambda desk, request: _json(opening.arrive(desk)),
        "/api/state": _state,
        "/api/projects": lambda desk, request: _json(opening.listed(desk)),
        "/api/report": lambda desk, request: _json(seeing.report_of(desk)),
        "/api/photo": _photo,
        "/api/mesh": _mesh,
        "/api/drawn/{kind}": _drawn,
        "/api/light/{name}": lambda desk, request: _jpeg(light_jpeg(request.path_params["name"])),
        "/api/example/{name}": _example,
        "/api/map/{name}": lambda desk, request: _jpeg(
            seeing.map_jpeg(desk, request.path_params["name"])
        ),
        "/api/picture/{project}/{name}": _picture,
        "/api/file/{file}": taking.download,
    }
    # --- The page, what it reads and posts, uploads, the channel, built files ---
    return [
        Route("/", _page),
        *(Route(place, got(desks, make)) for place, make in read.items()),
        *(
            Route(f"/api/{name}", posted(desks, kind, change), methods=["POST"])
            for name, (kind, change) in _POSTED.items()
        ),
        Route(UPLOAD, guarded(studio, upload), methods=["POST"]),
        WebSocketRoute(CHANNEL, socket),
        Route("/favicon.svg", _favicon),
        Mount("/assets", _Assets(directory=STATIC / "assets", check_dir=False)),
    ]


class _Assets(StaticFiles):
    """The built files. Their names stay the same, so a browser asks whether they have changed."""

    def file_response(self, *arguments: Any, **options: Any) -> Response:
        response = super().file_response(*arguments, **options)
        response.headers["cache-control"] = "no-cache"
        return response


async def _page(request: Request) -> Response:
    page = STATIC / "index.html"
    if not page.is_file():
        words = "The page is not built; see docs/studio.md: npm ci && npm run build in web/.\n"
        return PlainTextResponse(words, 503)
    return FileResponse(page, headers={"cache-control": "no-cache"})


async def _favicon(request: Request) -> Response:
    return FileResponse(STATIC / "favicon.svg")


def _state(desk: Desk, request: Request) -> Response:
    """What the page shows; the photo without its edits while the preview is still being built."""
    live = desk.session.live
    return _json(state(desk, with_edits=live is None or live.ready))


def _photo(desk: Desk, request: Request) -> Response:
    """The open photo; `working=1` at working size, `full=1` with all its pixels; `edited=1` with edits, no objects."""
    if "edited" in request.query_params:
        return _jpeg(seeing.skin_jpeg(desk))
    if "full" in request.query_params:
        return _jpeg(native_jpeg(desk, seeing.FULL_SIDE, 95))
    return _jpeg((working_jpeg if "working" in request.query_params else native_jpeg)(desk))


def _mesh(desk: Desk, request: Request) -> Response:
    return _bytes(seeing.mesh_bytes(desk))


def _drawn(desk: Desk, request: Request) -> Response:
    """What the page needs to draw a change of a kind itself; nothing where it cannot."""
    kind = request.path_params["kind"]
    if kind not in drawn.KINDS:
        raise InputError(f"The page draws no {kind!r}.")
    content = drawn.content(desk.session, kind)
    return Response(status_code=204) if content is None else _bytes(content)


def _bytes(content: bytes) -> Response:
    return Response(
        content, media_type="application/octet-stream", headers={"cache-control": "no-store"}
    )


def _example(desk: Desk, request: Request) -> Response:
    file = example_file(desk.studio, request.path_params["name"])
    return _jpeg(photo_jpeg(str(file), file.stat().st_mtime, 320))


def _picture(desk: Desk, request: Request) -> Response:
    file = opening.picture_of(desk, request)
    return _jpeg(photo_jpeg(str(file), file.stat().st_mtime, 1024))


def _json(content: Any) -> Response:
    return Answer(content, headers={"cache-control": "no-store"})


def _jpeg(content: bytes) -> Response:
    return Response(
        content, media_type="image/jpeg", headers={"cache-control": "private, no-cache"}
    )
