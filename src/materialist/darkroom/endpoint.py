"""From a function of a desk to an endpoint: who asks, what the body says, and errors as sentences."""

import json
import traceback
from collections.abc import Awaitable, Callable
from contextlib import AbstractContextManager
from typing import Any, TypeVar

from pydantic import ValidationError
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, Response

from materialist.darkroom.desk import Desk, Desks
from materialist.darkroom.requests import RequestBody, complaint
from materialist.errors import MaterialistError
from materialist.studio.access.gate import PAGE_HEADER
from materialist.studio.studio import LOCAL_PERSON, PERSON_HEADER, Studio

Kind = TypeVar("Kind", bound=RequestBody)
Answerer = Callable[[Request], Awaitable[Response]]


class Answer(JSONResponse):
    """JSON in ASCII: names of files may hold surrogates, which UTF-8 has not."""

    def render(self, content: Any) -> bytes:
        return json.dumps(content, allow_nan=False, separators=(",", ":")).encode()


def person_of(studio: Studio, request: Any) -> str:
    """The person of a request, whom the gate has named in a header."""
    return LOCAL_PERSON if studio.single_user else request.headers.get(PERSON_HEADER, "")


def desk_of(desks: Desks, request: Request) -> Desk:
    """The desk of the page that asks: named in a header, or in the address of a picture. Raises InputError."""
    page = request.headers.get(PAGE_HEADER) or request.query_params.get("page")
    return desks.of(page, person_of(desks.studio, request))


def posted(desks: Desks, kind: type[Kind], change: Callable[[Desk, Kind], Any]) -> Answerer:
    """An endpoint that reads a body and answers with what change(desk, body) returns, as JSON."""

    async def answer(request: Request) -> Response:
        with _counted(desks, request):
            # The page first: what is refused takes no memory for its body.
            await run_in_threadpool(_at_desk, desks, request, lambda desk: None)
            raw = await request.body()

            def changed(desk: Desk) -> Any:
                return change(desk, kind.model_validate_json(raw or b"{}"))

            return Answer(await run_in_threadpool(_at_desk, desks, request, changed))

    return guarded(desks.studio, answer)


def got(desks: Desks, make: Callable[[Desk, Request], Response]) -> Answerer:
    """An endpoint that answers with make(desk, request)."""

    async def answer(request: Request) -> Response:
        def made(desk: Desk) -> Response:
            return make(desk, request)

        with _counted(desks, request):
            return await run_in_threadpool(_at_desk, desks, request, made)

    return guarded(desks.studio, answer)


def _counted(desks: Desks, request: Request) -> AbstractContextManager[None]:
    """A place among the requests of a sender, who must not keep all threads busy. Raises InputError for none."""
    studio = desks.studio
    return studio.quota.request(studio.sender(person_of(studio, request)))


def _at_desk(desks: Desks, request: Request, work: Callable[[Desk], Any]) -> Any:
    """What work(desk) gives at the desk of the page that asks."""
    desk = desk_of(desks, request)
    with desk.page.at_work():
        return work(desk)


def guarded(studio: Studio, answer: Answerer) -> Answerer:
    """The endpoint, whose errors are answers: {"error": a sentence}, and the status that fits."""

    async def careful(request: Request) -> Response:
        # 422 for what is no such request, 400 for what the user can mend, 500 for our faults.
        try:
            return await answer(request)
        except ValidationError as error:
            return refusal(complaint(error), 422)
        except MaterialistError as error:
            return refusal(studio.without_folders(str(error)), 400)
        except HTTPException as error:
            return refusal(str(error.detail), error.status_code)
        except Exception as error:
            traceback.print_exception(error)
            name = type(error).__name__
            words = (
                f"Something went wrong inside ({name}); the terminal of the studio has the details."
            )
            return refusal(words, 500)

    return careful


def refusal(words: str, status: int) -> Response:
    return Answer({"error": words}, status)
