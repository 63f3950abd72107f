"""The running studio: its work folder, its queue of jobs, and the pages that are open."""

from __future__ import annotations

import ctypes
import gc
import os
import re
import secrets
import shutil
import threading
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from materialist.errors import InputError, OutputError
from materialist.jobs.queue import Job, JobQueue
from materialist.studio import SETTINGS, tasks
from materialist.studio.session import Session
from materialist.studio.workspace import Project, WorkFolder

ALONE = "me"
"""The person, where the studio serves this machine only."""


@dataclass
class Studio:
    """The state that all pages share."""

    work: WorkFolder
    jobs: JobQueue
    alone: bool = True
    """Served on this machine only: everyone on it is the same person."""
    start: Project | Path | None = None
    """The scene to open first, or the photo to show on the opening tab."""
    seed: int = 0
    """Of inversions."""
    device: str = "auto"
    """Of jobs, as `invert` takes it."""
    run: str = field(default_factory=lambda: secrets.token_hex(4))
    """Tells this studio from the ones before it in what a browser keeps."""
    _sessions: dict[str, Session] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def person(self, token: Any) -> str:
        """The person of a page, from the token that its browser keeps. Raises InputError for an invalid token."""
        if self.alone:
            return ALONE
        if not isinstance(token, str) or not re.fullmatch(r"[a-z0-9]{16,32}", token):
            raise InputError("The page has lost its session; reload it.")
        return token

    def session(self, page: str | None, person: str | None = None) -> Session:
        """The session of a page, by Gradio's session hash; `person` starts one. Raises InputError where it is gone."""
        if not page:
            raise InputError("The page has lost its session; reload it.")
        with self._lock:
            known = self._sessions.get(page)
            if known is None or (person is not None and known.person != person):
                if person is None and not self.alone:
                    raise InputError("The page has lost its session; reload it.")
                known = self._sessions[page] = Session(person or ALONE)
            return known

    def projects(self, person: str) -> list[Project]:
        """The projects that a person may open: all on one's own machine, else one's own and `start`."""
        every = self.work.projects(None if self.alone else person)
        start = self.start
        return every if not isinstance(start, Project) or start in every else [*every, start]

    def project(self, name: str, person: str) -> Project:
        """The project of a name that came from a page. Raises InputError where this person has no such project."""
        for project in self.projects(person):
            if project.name == name:
                return project
        raise InputError("This photo is no longer in the work folder; open it again.")

    def bookmark(self, project: Project) -> str:
        """The text by which a browser remembers the photo it shows."""
        return f"{self.run}/{project.name}"

    def is_bookmark(self, kept: Any) -> bool:
        """Whether a browser kept this text from this studio, and not from one before it."""
        return str(kept or "").rpartition("/")[0] == self.run

    def first(self, kept: Any) -> str:
        """The name of the project that a page which arrives should show; an empty text for none.

        The photo it showed before, if that was in this studio; else what this studio was started on.
        """
        run, _, name = str(kept or "").rpartition("/")
        return self.start.name if isinstance(self.start, Project) and run != self.run else name

    def open(self, session: Session, name: str) -> None:
        """Open a project of this person on a page. Raises InputError where the memory would not suffice."""
        import psutil

        project = self.project(name, session.person)
        session.close()
        free()
        if psutil.virtual_memory().available < SETTINGS.free_for_scene:
            raise InputError("This machine has no memory left for another scene; close one in another tab.")
        session.open(project)
        self.work.touch(project)

    def job(self, session: Session, task: tasks.Task, folder: Path, **arguments: Any) -> Job:
        """A job for a page: a function of `tasks`, which writes into `folder`."""
        return Job(task.__name__, session.person, folder, partial(tasks.on_device, self.device, task), arguments)

    def submit(self, session: Session, task: tasks.Task, folder: Path, **arguments: Any) -> Job:
        """Put a job for a page in the queue."""
        job = self.jobs.submit(self.job(session, task, folder, **arguments))
        session.note_job(job)
        return job

    def leave(self, page: str | None) -> None:
        """Forget a page that was closed, its memory, and its renderings; its work and its inversions go on."""
        with self._lock:
            session = self._sessions.pop(page or "", None)
        if session is not None:
            session.end(self.jobs)
            session.close()
            del session
            free()

    def final_file(self, session: Session) -> Path:
        """Where a page's path-traced pictures lie, without the ending; they go when the studio ends."""
        return self.work.cache / f"final-{session.mark}"

    def public_copy(self, file: Path) -> str:
        """A copy of a result in the cache, the only place of served files, in a folder with a random name."""
        folder = self.work.cache / secrets.token_hex(16)
        try:
            folder.mkdir()
            copy = folder / file.name
            try:
                os.link(file, copy)
            except OSError:
                shutil.copyfile(file, copy)
        except OSError as error:
            raise OutputError(f"The file {file.name} cannot be handed over: {error.strerror or error}.") from error
        return str(copy)


def free() -> None:
    """Give unused memory back to the system at once, where the C library can."""
    gc.collect()
    try:
        ctypes.CDLL("libc.so.6").malloc_trim(0)
    except (OSError, AttributeError):
        return
