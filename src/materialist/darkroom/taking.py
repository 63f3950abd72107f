"""The final picture, files to take away, and lists of edits to load."""

import secrets
from pathlib import Path
from typing import Any

from starlette.requests import Request
from starlette.responses import FileResponse, Response

from materialist.darkroom import requests
from materialist.darkroom.desk import Desk, Followed
from materialist.darkroom.state import state
from materialist.edits.recipe import Step
from materialist.errors import InputError
from materialist.jobs.worker import DONE
from materialist.studio import tasks
from materialist.studio.archives import pack_edits
from materialist.studio.finals import FinalPicture, keep_final, new_final
from materialist.studio.session import EDITS
from materialist.studio.tasks import KINDS, PICTURES, kinds_here
from materialist.studio.workspace import Project


def render(desk: Desk, body: requests.Nothing) -> dict[str, Any]:
    """Path-trace the edits; the page shows the picture when it is there."""
    _active_steps(desk)
    _traced(desk, None)
    return state(desk)


def take(desk: Desk, body: requests.Take) -> dict[str, Any]:
    """Make a file to take away; the page gets its id when it is there."""
    session = desk.session
    if body.kind not in kinds_here():
        raise InputError(f"There is no '{body.kind}' to take away; choose one of the list.")
    # --- The list of edits and path-traced pictures need no job of their own ---
    project = session.opened
    file = session.workspace / f"take-{body.kind}{KINDS[body.kind][1]}"
    if body.kind == "edits":
        steps = _active_steps(desk)
        session.save()
        pack_edits(session.edits.steps or steps, session.workspace / EDITS, file)
        return {"result": _handed(desk, project, body.kind, file)}
    if body.kind in PICTURES:
        final = session.final
        if final is not None and final.of(session.edits.active):
            return _from_final(desk, project, final, body.kind)
        _active_steps(desk)
        _traced(desk, body.kind)
        return {}
    # --- Everything else is made by a job, and handed over when it is done ---
    job = desk.studio.submit(
        session,
        tasks.take,
        file.parent,
        scene=str(project.scene),
        output=str(file),
        steps=session.edits.active,
        kind=body.kind,
    )

    def hand_over(entry: Followed) -> None:
        if entry.job.state == DONE:
            entry.result = _handed(desk, project, body.kind, file)

    desk.follow(job, hand_over)
    return {}


def load(desk: Desk, body: requests.LoadedList) -> dict[str, Any]:
    """Put the steps of an uploaded list in place of the edits."""
    desk.session.read_edits(desk.studio.files.path(desk.person, body.file))
    return state(desk)


def download(desk: Desk, request: Request) -> Response:
    """A file that was handed over to this person."""
    file = desk.studio.files.path(desk.person, request.path_params["file"])
    return FileResponse(file, filename=file.name, content_disposition_type="attachment")


def _active_steps(desk: Desk) -> tuple[Step, ...]:
    _ = desk.session.scene
    steps = desk.session.edits.active
    if not steps:
        raise InputError("There is no edit yet: change something first.")
    return steps


def _traced(desk: Desk, kind: str | None) -> None:
    """Begin to path-trace the edits; with a kind its file is handed over then. It goes on when the page is closed."""
    session = desk.session
    studio = desk.studio
    project = session.opened
    workspace = session.workspace
    # --- The job, into a file named by these edits ---
    picture = new_final(workspace, session.edits.active)
    job = studio.submit(
        session,
        tasks.final,
        workspace,
        scene=str(project.scene),
        output=str(picture.path),
        steps=picture.steps,
    )

    def keep(entry: Followed) -> None:
        if entry.job.state != DONE:
            picture.remove()
            return
        keep_final(workspace, picture)
        # Whichever pages show the photo by now.
        shown = studio.session_on(project, desk.person)
        if shown is not None:
            shown.final = picture
            shown.changed()
        if kind is not None and not desk.page.left:
            entry.result = _from_final(desk, project, picture, kind).get("result")

    desk.follow(job, keep)


def follow_finals(desk: Desk) -> None:
    """Show the path tracing of the open photo that an earlier page has begun."""
    workspace = desk.session.workspace
    followed = [entry.job for entry in desk.followed]
    for job in desk.studio.jobs.unfinished(desk.person, "final"):
        if job.folder == workspace and job not in followed:
            desk.follow(job, lambda entry: None)


def _from_final(desk: Desk, project: Project, picture: FinalPicture, kind: str) -> dict[str, Any]:
    """A path-traced picture as a file for the page: at once, or by a job that converts it first."""
    file = picture.path.with_name(picture.path.name + PICTURES[kind])
    if file.is_file():
        return {"result": _handed(desk, project, kind, file)}
    job = desk.studio.submit(
        desk.session,
        tasks.converted,
        file.parent,
        scene=str(project.scene),
        source=str(picture.path.with_suffix(".exr")),
        output=str(file),
    )

    def hand_over(entry: Followed) -> None:
        if entry.job.state == DONE:
            entry.result = _handed(desk, project, kind, file)

    desk.follow(job, hand_over)
    return {}


def _handed(desk: Desk, project: Project, kind: str, file: Path) -> dict[str, Any]:
    """A copy of a file for the person of a page, under a name that says what it is."""
    label = "edited" if kind in PICTURES else kind
    name = f"{project.stem}-{label}{file.suffix}"
    person = desk.person
    copy = Path(desk.studio.public_copy(person, file, name))
    handle = desk.studio.files.hand_out(person, copy, f"result-{secrets.token_hex(16)}")
    return {"file": handle, "name": name, "bytes": copy.stat().st_size}
