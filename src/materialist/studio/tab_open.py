"""The tab that opens a photo, a scene, an example, or an earlier project."""

import shutil
from collections.abc import Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any

import cv2
import gradio as gr
import numpy as np

from materialist.errors import InputError
from materialist.io.decode import SUFFIXES
from materialist.io.photo import EXAMPLES, example_path
from materialist.jobs.queue import Job
from materialist.studio import tasks, uploads
from materialist.studio.controls import file_field
from materialist.studio.session import Session
from materialist.studio.stage import stage, waiting_photo
from materialist.studio.studio import PREDICTORS
from materialist.studio.widgets import LONG, PageContext, Updates, message_box
from materialist.studio.workspace import Project
from materialist.types import Array

SIZES = tuple((f"{side} pixels", side) for side in (256, 384, 512, 768, 1024))
_READY = "Ready: click an object, then move a slider."


def layout(context: PageContext) -> None:
    parts = context.parts
    with gr.Tab("Open", id="open"):
        parts["file"] = file_field(
            "file", "Drop a photo, or a zipped scene (up to 60 MB)", SUFFIXES | {".zip"}
        )
        parts["facts"] = gr.HTML("", elem_id="facts", js_on_load=None)
        with gr.Row():
            parts["predictor"] = gr.Dropdown(
                list(PREDICTORS),
                value="auto",
                label="First guess by",
                min_width=150,
                info="MatNet and Marigold need their weights",
            )
            parts["size"] = gr.Dropdown(list(SIZES), value=512, label="Working size", min_width=130)
            parts["fov"] = gr.Textbox(
                "auto", label="Field of view, degrees", max_lines=1, min_width=130
            )
        parts["start"] = gr.Button("Take the photo apart", variant="primary", elem_id="start")
        parts["found"] = gr.Gallery(
            label="Found so far",
            columns=3,
            height="auto",
            visible=False,
            object_fit="contain",
            interactive=False,
            buttons=[],
        )
        gr.Markdown("Or take an example photo:")
        parts["examples"] = gr.Gallery(
            _examples(),
            label="Example photos",
            show_label=False,
            columns=4,
            height="auto",
            allow_preview=False,
            object_fit="cover",
            interactive=False,
            buttons=[],
            elem_id="examples",
            format="jpeg",
        )
        parts["projects"] = gr.Dropdown(
            [], label="Continue where you left", value=None, elem_id="projects"
        )
        parts["continue"] = gr.Button("Continue", size="sm", elem_id="continue")


def wire(context: PageContext, page: gr.Blocks) -> None:
    parts = context.parts
    studio = context.studio

    def uploaded(session: Session, file: str | None) -> Iterator[Updates]:
        # A zip is opened when the button is pressed; a photo is checked at once.
        name = Path(file or "").name
        if name.lower().endswith(".zip"):
            yield {"facts": message_box(f"{name} will be opened as a scene.")}
            return
        if file is not None:
            uploads.opened_upload(
                uploads.checked_upload, Path(file), session.allowance, option=uploads.PHOTO
            )
        yield {"facts": message_box(f"{name} is ready.") if file else ""}

    def choose_example(session: Session, data: Any) -> Iterator[Updates]:
        name = [*EXAMPLES][int(data["index"])]
        gr.Info(EXAMPLES[name][1], title="Example photo")
        file = example_path(name)
        yield {"file": studio.public_copy(session.person, file, f"{name}{file.suffix}")}

    def start(
        session: Session, file: str | None, predictor: str, size: int, fov: str
    ) -> Iterator[Updates]:
        if file is not None and Path(file).suffix.lower() == ".zip":
            yield from _show_project(context, session, studio.unpack(session, Path(file)))
        else:
            if file is None:
                raise InputError("Drop a photo first, or choose an example.")
            project, job = studio.begin(session, Path(file), predictor, int(size), fov)
            yield from _follow_inversion(context, session, project, job)

    def arrive(session: Session) -> Iterator[Updates]:
        # --- What this person can go on with ---
        known = _projects(context, session)
        last = studio.last.get(session.person)
        yield {"projects": gr.update(choices=known, value=known[0][1] if known else None)}
        # --- What the page shows first: the last photo, or what the studio was started on ---
        if not any(value == last for _, value in known):
            last = studio.start.name if isinstance(studio.start, Project) else None
        if last is not None:
            yield from _resume(context, session, last)
        elif isinstance(studio.start, Path):
            yield {"file": studio.public_copy(session.person, studio.start)}

    sent = context.long(parts["file"].change, uploaded, "file")
    sent.failure(lambda: None, None, parts["file"], **LONG)  # what was refused is not there
    context.long(parts["examples"].select, choose_example, data=True)
    context.long(parts["start"].click, start, "file", "predictor", "size", "fov")
    context.long(parts["continue"].click, partial(_resume, context), "projects")
    context.long(page.load, arrive)


@cache
def _examples() -> list[tuple[Array, str]]:
    """Small pictures of the example photos, with their names."""
    photos = {name: np.asarray(cv2.imread(str(example_path(name))))[..., ::-1] for name in EXAMPLES}

    def small(photo):
        return cv2.resize(
            photo, None, fx=(s := 240 / photo.shape[1]), fy=s, interpolation=cv2.INTER_AREA
        )

    return [(small(photo), name.capitalize()) for name, photo in photos.items()]


def _follow_inversion(
    context: PageContext, session: Session, project: Project, job: Job
) -> Iterator[Updates]:
    """Progress and first pictures of an inversion until it is over; then the project, if it is done."""
    studio = context.studio
    studio.note_last(session.person, project.name)
    yield {"start": gr.update(interactive=False)}
    shown = 0
    for update in context.following(session, job):
        if len(job.intermediate) > shown:
            latest = {facts["name"]: project.folder / facts["file"] for facts in job.intermediate}
            # The photo goes to the stage, maps go to the gallery.
            photo = latest.pop(tasks.PHOTO)
            if not shown:
                update["stage"] = waiting_photo(photo)
            shown = len(job.intermediate)
            pictures = [
                (studio.public_copy(session.person, file), name) for name, file in latest.items()
            ]
            update["found"] = gr.update(value=pictures, visible=bool(pictures))
        yield update
    if not job.over:  # the page was closed, or follows the inversion anew; it goes on
        return
    failed = job.state != "done"
    # Nothing to go on with: the folder goes.
    if failed and not project.ready:
        shutil.rmtree(project.folder, ignore_errors=True)
    before = (
        {"found": gr.update(visible=False, value=[]), "stage": stage(session)} if failed else {}
    )
    yield {
        "start": gr.update(interactive=True),
        **before,
    }  # at last: a click before the event's end is lost
    if project.ready:
        yield from _show_project(context, session, project)


def _resume(context: PageContext, session: Session, name: str | None) -> Iterator[Updates]:
    """Open a project, or follow its inversion if that still runs."""
    studio = context.studio
    if not name:
        raise InputError("Choose one of your photos in the list first.")
    project = studio.project(name, session.person)
    # A page that was reloaded follows the inversion that still runs.
    running = [
        j for j in studio.jobs.unfinished(session.person, "invert") if j.folder == project.folder
    ]
    if running:
        session.note_job(running[0])
        yield from _follow_inversion(context, session, project, running[0])
    elif project.ready:
        yield from _show_project(context, session, project)
    else:
        raise InputError("That photo was not taken apart to the end; start again.")


def _show_project(context: PageContext, session: Session, project: Project) -> Iterator[Updates]:
    """Show a project: its photo at once, the edits when the preview is ready."""
    yield {"progress": message_box("Opening …")}
    context.studio.open(session, project.name)
    live = session.live
    if live is None:
        return
    known = _projects(context, session)
    yield context.everything(session) | {
        "stage": stage(session, with_edits=False),
        "tabs": gr.Tabs(selected="material"),
        "projects": gr.update(choices=known, value=project.name),
        "found": gr.update(visible=False, value=[]),
        "progress": message_box("Getting the live preview ready; select something meanwhile.", 0.6),
    }
    # Another photo may have been opened meanwhile.
    live.wait()
    if session.live is live:
        yield context.everything(session) | {"progress": message_box(_READY)}


def _projects(context: PageContext, session: Session) -> list[tuple[str, str]]:
    projects = context.studio.projects(session.person)
    running = {j.folder for j in context.studio.jobs.unfinished(session.person, "invert")}
    return [
        (f"{p.title} · {p.name}" + ("" if p.ready else " (in work)"), p.name)
        for p in projects
        if p.ready or p.folder in running
    ]
