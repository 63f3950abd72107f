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
    "walls": "Finding where walls end", "geometry": "Building the surface", "trace": "Tracing light paths",
    "light": "Finding the light", "materials": "Finding the materials",
    "rerender": "Rendering the result", "save": "Saving", "load": "Loading", "render": "Path tracing",
    "frames": "Path tracing the frames", "export": "Writing the file",
}  # fmt: skip
_SHARE = {
    "start": (0.0, 0.08), "read": (0.08, 0.1), "predict": (0.1, 0.14), "walls": (0.14, 0.24),
    "geometry": (0.24, 0.27), "light": (0.27, 0.42), "trace": (0.42, 0.53),
    "materials": (0.53, 0.72), "rerender": (0.72, 0.97), "save": (0.97, 1.0),
}  # fmt: skip
"""Stage of an inversion -> where its part of the bar begins and ends, by the seconds that it usually takes."""


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
        ahead = jobs.ahead(job)
        who = "1 other piece of work is" if ahead == 1 else f"{ahead} other pieces of work are"
        return box(f"Waiting: {who} before yours." if ahead else "Waiting for its turn.", 0.0)
    if job.state == STOPPED:
        return box("Stopped; nothing was changed.")
    if job.state == FAILED:
        return box(failure(job), bad=True)
    if job.over:
        return box(f"Done in {job.seconds:.0f} s.")
    return box(f"{words(job.stage)} … {job.seconds:.0f} s", share(job))


def failure(job: Job) -> str:
    """The reason of a failure; it names files without their folders, and the photo by its title."""
    text = job.message
    for step in job.arguments.get("steps", ()):
        text = text.replace(f"{step.folder}/", "")
    for key in ("photo", "scene", "output", "mesh"):
        if key in job.arguments:
            file = Path(job.arguments[key])
            text = without_paths(
                text, file, str(job.arguments.get("title", file.name)) if key == "photo" else file.name
            )
    return text


def words(stage: str) -> str:
    """A stage in words; names such as `light 2` or `materials: albedo` go by their first word."""
    key = stage.replace(":", " ").split()[0] if stage.split() else ""
    return _WORDS.get(stage) or next(
        (text for name, text in _WORDS.items() if key.startswith(name)), stage.capitalize()
    )


def share(job: Job) -> float:
    """How much of a job is done, in [0, 1]; it never runs back."""
    inside = min(1.0, job.done / job.total) if job.total else 0.0
    if job.kind == "invert":
        low, high = next((part for name, part in _SHARE.items() if job.stage.startswith(name)), (0.0, 0.0))
        inside = low + (high - low) * inside
    job.shown = max(job.shown, inside)
    return job.shown


def box(text: str, part: float | None = None, bad: bool = False) -> str:
    """A line of text, with a bar where there is something to measure."""
    bar = "" if part is None else f'<div class="bar"><i style="width:{100 * part:.0f}%"></i></div>'
    kind, role = ("progress bad", "alert") if bad else ("progress", "status")
    return f'<div class="{kind}" role="{role}">{escape(text)}{bar}</div>'
