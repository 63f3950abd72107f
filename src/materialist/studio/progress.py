"""Progress of a job, in words and as a bar."""

from __future__ import annotations

import time
from collections.abc import Iterator
from html import escape
from pathlib import Path

from materialist.jobs.queue import QUEUED, STOPPED, Job, JobQueue
from materialist.jobs.worker import FAILED
from materialist.studio import SETTINGS
from materialist.studio.uploads import without_paths

_WORDS = {
    "start": "Starting", "read": "Reading the photo", "predict": "Guessing colours, shapes and depth",
    "geometry": "Building the surface", "trace": "Tracing light paths", "light": "Finding the light",
    "materials": "Finding the materials", "rerender": "Rendering the result", "save": "Saving", "load": "Loading",
    "render": "Path tracing", "frames": "Path tracing the frames", "export": "Writing the file",
}  # fmt: skip


def follow(jobs: JobQueue, job: Job) -> Iterator[str]:
    """The state of a job as HTML whenever it changed, until it is over; the last one says how it ended."""
    last = ""
    while not job.over:
        text = shown(jobs, job)
        if text != last:
            last = text
            yield text
        time.sleep(SETTINGS.poll_seconds)
    yield shown(jobs, job)


def shown(jobs: JobQueue, job: Job) -> str:
    """One state as HTML."""
    if job.state == QUEUED:
        return box(f"Waiting: {jobs.ahead(job)} before yours.", 0.0)
    if job.state == STOPPED:
        return box("Stopped; nothing was changed.")
    if job.state == FAILED:
        return box(failure(job), bad=True)
    if job.over:
        return box(f"Done in {job.seconds:.0f} s.")
    return box(f"{words(job.stage)} … {job.seconds:.0f} s", min(1.0, job.done / job.total) if job.total else 0.0)


def failure(job: Job) -> str:
    """The reason of a failure; it names files without their folders, and the photo by its title."""
    text = job.message
    for step in job.arguments.get("steps", ()):
        text = text.replace(f"{step.folder}/", "")
    for key in ("photo", "scene", "output"):
        if key in job.arguments:
            file = Path(job.arguments[key])
            title = job.arguments.get("title", file.name) if key == "photo" else file.name
            text = without_paths(text, file, str(title))
    return text


def words(stage: str) -> str:
    """A stage in words; names such as `light 2` or `materials: albedo` go by their first word."""
    return _WORDS.get(stage) or _WORDS.get(stage.replace(":", " ").partition(" ")[0], stage.capitalize())


def box(text: str, part: float | None = None, bad: bool = False) -> str:
    """A line of text, with a bar where there is something to measure."""
    bar = "" if part is None else f'<div class="bar"><i style="width:{100 * part:.0f}%"></i></div>'
    kind, role = ("progress bad", "alert") if bad else ("progress", "status")
    return f'<div class="{kind}" role="{role}">{escape(text)}{bar}</div>'
