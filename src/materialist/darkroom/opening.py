"""Uploads, and photos that are taken apart, opened again, renamed and deleted."""

import asyncio
import re
import secrets
import shutil
import time
import traceback
from pathlib import Path
from typing import Any

from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response

from materialist.darkroom import requests
from materialist.darkroom.desk import POLL, Desk, Desks, Followed, found_file
from materialist.darkroom.endpoint import desk_of
from materialist.darkroom.state import example_file, project_facts, state
from materialist.darkroom.taking import follow_finals
from materialist.errors import InputError, MaterialistError
from materialist.io.atomic import writing
from materialist.jobs.queue import Job
from materialist.studio import SETTINGS
from materialist.studio.access.gate import promised_size
from materialist.studio.workspace import Project

State = dict[str, Any]


async def receive_upload(desks: Desks, request: Request) -> Response:
    """Store the body as an upload of this person, and answer with its id. Nothing of it is opened yet."""
    desk = desk_of(desks, request)
    studio = desks.studio
    person = desk.person
    size = promised_size(request)
    sender = studio.sender(person)
    # --- Room for it is claimed before, and settled by what came ---
    with studio.quota.uploading(sender):
        claim = studio.quota.claim(sender, size)
        folder = studio.work.cache / secrets.token_hex(16)
        file = folder / _safe_name(request.query_params.get("name", ""))
        stored = 0
        try:
            with writing(file.name):
                folder.mkdir()
            stored = await _written(request, file, size)
        except (ClientDisconnect, TimeoutError) as error:
            raise InputError("The upload ended too early; send the file again.") from error
        finally:
            studio.quota.settle(claim, stored)
            if not stored:
                shutil.rmtree(folder, ignore_errors=True)
    return JSONResponse({"file": studio.files.add(person, file), "name": file.name})


async def _written(request: Request, file: Path, size: int) -> int:
    """Write a body to a file; returns its bytes. Raises InputError where they are not as many as promised."""
    stored = 0
    parts = request.stream()
    # On a full disk it is the file that cannot be written, not this program that fails.
    with writing(file.name), file.open("wb") as out:
        while True:
            try:
                part = await asyncio.wait_for(anext(parts), SETTINGS.body_seconds)
            except StopAsyncIteration:
                break
            stored += len(part)
            if stored > size:
                break
            out.write(part)
    if stored != size or not stored:
        raise InputError("The upload is empty, or not as long as it says; send the file again.")
    return stored


def _safe_name(name: str) -> str:
    """The name of an upload without folders: letters, digits, and what else is harmless in a name."""
    bare = re.sub(r"[^\w .()-]+", "_", Path(name.replace("\\", "/")).name).strip(" .")
    # In bytes: a letter may have four, and a name in a folder 255.
    short = bare.encode("utf-8", "replace")[-80:].decode("utf-8", "ignore")
    return short.lstrip(" .") or "upload"


# Projects


def start(desk: Desk, body: requests.Start) -> State:
    """Take a photo apart; a zipped scene is opened as it is."""
    studio = desk.studio
    source = _source(desk, body)
    if source.suffix.lower() == ".zip":
        return _opened(desk, studio.unpack(desk.session, source))
    project, job = studio.begin(desk.session, source, body.predictor, body.size, body.fov)
    studio.note_last(desk.person, project.name)
    _expect(desk, project, job)
    return state(desk)


def _source(desk: Desk, body: requests.Start) -> Path:
    """The file of a photo. Raises InputError for none, and for another's."""
    studio = desk.studio
    person = desk.person
    if body.file is not None:
        return studio.files.path(person, body.file)
    if body.example is None:
        raise InputError("Drop a photo first, or choose an example.")
    file = example_file(studio, body.example)
    if body.example == "start":
        return file
    return Path(studio.public_copy(person, file, f"{body.example}{file.suffix}"))


def open_project(desk: Desk, body: requests.Named) -> State:
    """Open a project of this person, or follow its inversion if that still runs."""
    project = desk.studio.project(body.project, desk.person)
    job = _running(desk, project)
    if job is not None:
        _expect(desk, project, job)
        return state(desk)
    if not project.ready:
        raise InputError("That photo was not taken apart to the end; give it again.")
    return _opened(desk, project)


def arrive(desk: Desk) -> State:
    """What a page shows when it is loaded: as it was left, else the photo that this person had last."""
    session = desk.session
    studio = desk.studio
    start = studio.start.name if isinstance(studio.start, Project) else None
    last = studio.last.get(desk.person) or start
    known = {project["name"] for project in listed(desk)}
    try:
        if session.project is None and desk.expected is None and last in known:
            return open_project(desk, requests.Named(project=str(last)))
        session.take_over()
    except MaterialistError as error:
        return {**state(desk), "notes": [session.without_folders(str(error))]}
    except Exception as error:
        # A photo that cannot be shown must not keep its owner from the others.
        traceback.print_exception(error)
        words = f"The photo was closed: something went wrong inside ({type(error).__name__})."
        return {**close_project(desk, requests.Nothing()), "notes": [words]}
    if session.project is None:
        studio.get_ready()
    return state(desk)


def close_project(desk: Desk, body: requests.Nothing) -> State:
    """Back to the choice of photos; edits and inversions stay."""
    desk.studio.put_away(desk.page)
    desk.expected = None
    desk.studio.forget_last(desk.person)
    desk.studio.get_ready()
    return state(desk)


def listed(desk: Desk) -> list[State]:
    """The projects of a person, the newest first."""
    running = {job.folder for job in desk.studio.jobs.unfinished(desk.person, "invert")}
    return [
        {**(project_facts(project) or {}), "ready": project.ready}
        for project in desk.studio.projects(desk.person)
        if project.ready or project.folder in running
    ]


def rename(desk: Desk, body: requests.Renamed) -> list[State]:
    renamed = desk.studio.work.rename(_own(desk, body.project), body.title)
    session = desk.studio.session_on(renamed, desk.person)
    if session is not None and session.project is not None:
        session.project = renamed
        session.changed()
    return listed(desk)


def discard(desk: Desk, body: requests.Named) -> list[State]:
    """Delete a project of this person, stopping its inversion; the open one is closed first."""
    project = _own(desk, body.project)
    desk.studio.discard(project)
    return listed(desk)


def picture_of(desk: Desk, request: Request) -> Path:
    """The file of a project's picture: its photo, or a map that its inversion has found."""
    project = desk.studio.project(request.path_params["project"], desk.person)
    name = request.path_params["name"]
    scene_photo = project.scene / "photo.png"
    if name == "photo" and scene_photo.is_file():
        return scene_photo
    return found_file(project, name)


def _own(desk: Desk, name: str) -> Project:
    """A project that belongs to a person. Raises InputError for another's, even where it may be opened."""
    project = desk.studio.project(name, desk.person)
    if project.owner != desk.person:
        raise InputError("That photo belongs to somebody else.")
    return project


def _running(desk: Desk, project: Project) -> Job | None:
    """The inversion that makes the scene of a project; None where there is one already."""
    if project.ready:
        return None
    jobs = desk.studio.jobs.unfinished(desk.person, "invert")
    return next((job for job in jobs if job.folder == project.folder), None)


def _opened(desk: Desk, project: Project) -> State:
    """Open a project; its photo is shown at once, the edits when the preview is ready."""
    desk.studio.open(desk.page, project.name)
    desk.expected = None
    follow_finals(desk)
    return state(desk, with_edits=False)


def _expect(desk: Desk, project: Project, job: Job) -> None:
    """Follow an inversion, and open its project once it has a scene, unless another photo was opened meanwhile."""
    if any(entry.job is job and not entry.finished for entry in desk.followed):
        desk.expected = project
        return
    desk.studio.put_away(desk.page)
    desk.expected = project

    def then(entry: Followed) -> None:
        if not project.ready:
            # Nothing to go on with: the folder goes.
            desk.studio.work.drop(project)
        expected = desk.expected == project
        try:
            if expected and project.ready and not desk.page.left:
                _open_first(desk, project, job)
            elif project.ready:
                entry.notes.append(f"{project.title} is ready; it is among your photos.")
        finally:
            if desk.expected == project:
                desk.expected = None

    desk.follow(job, then, lambda: project.ready)


def _open_first(desk: Desk, project: Project, job: Job) -> None:
    """Open a project whose inversion may still run; where memory is short, when that has given its own back."""
    try:
        desk.studio.open(desk.page, project.name)
    except InputError:
        if job.over:
            raise
        while not job.over:
            time.sleep(POLL)
        if desk.expected == project and not desk.page.left:
            desk.studio.open(desk.page, project.name)
