"""The running studio: its work folder, its queue of jobs, and the pages that are open."""

import re
import secrets
import shutil
import threading
import time
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import psutil

from materialist.errors import InputError
from materialist.io.atomic import writing
from materialist.jobs.queue import Job, JobQueue
from materialist.studio import SETTINGS, tasks
from materialist.studio.preview import free_memory
from materialist.studio.session import ENDING, Session
from materialist.studio.workspace import Project, WorkFolder

LOCAL_PERSON = "me"
"""The person, where the studio serves this machine only."""
PERSON = "materialist_person"
"""The cookie that tells whose photos a browser may see."""
_FOLDERS = re.compile(r"(?<![\w/:.<])/(?:[^/\s<>'\"]+/)*(?=[^/\s<>])")
LOST = "The page has lost its session; reload it."


@dataclass
class Studio:
    """The state that all pages share."""

    work: WorkFolder
    jobs: JobQueue
    single_user: bool = True
    """Served on this machine only: everyone on it is the same person."""
    start: Project | Path | None = None
    """The scene to open first, or the photo to show on the opening tab."""
    seed: int = 0
    device: str = "auto"
    last: dict[str, str] = field(default_factory=dict)
    """Person -> the project last opened or begun; a page that is loaded again goes on with it."""
    _sessions: dict[str, Session] = field(default_factory=dict)
    _uploads: list[tuple[float, str, int]] = field(default_factory=list)
    """When, by whom, and how many bytes, within the last hour."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def person(self, token: Any) -> str:
        """The person of a page, from the cookie that its browser keeps. Raises InputError for an invalid one."""
        if self.single_user:
            return LOCAL_PERSON
        if not isinstance(token, str) or not re.fullmatch(r"[a-f0-9]{32}", token):
            raise InputError(LOST)
        return token

    def session(self, page: str | None, person: str, *, beats: bool = False) -> Session:
        """The session of a page, by Gradio's session hash; `beats` where the page holds a request until it is closed.

        Forgets pages that never did so, a while after their last request. Raises InputError for another person's page.
        """
        now = time.monotonic()
        with self._lock:
            last = now - SETTINGS.page_seconds
            gone = [name for name, one in self._sessions.items() if not one.beats and one.seen < last and name != page]
            known = (
                self._sessions.setdefault(page, Session(person, self.without_folders, self.single_user))
                if page
                else None
            )
            if known is not None and known.person == person:
                known.seen, known.beats = now, known.beats or beats
        for name in gone:
            self.leave(name)
        if known is None or known.person != person:
            raise InputError(LOST)
        return known

    def without_folders(self, text: str) -> str:
        """A text for a page: names in place of the paths of this machine."""
        for root in (self.work.root, self.work.cache):
            text = text.replace(f"{root}/", "/")
        return _FOLDERS.sub("", text)

    def note_upload(self, person: str, size: str) -> None:
        """Count an upload by its Content-Length. Raises InputError above the quota, and where the disk is full."""
        if not size.isdigit():
            raise InputError("An upload must say how long it is.")
        now = time.monotonic()
        with self._lock:
            self._uploads = [one for one in self._uploads if now - one[0] < 3600]
            if sum(bytes_ for _, who, bytes_ in self._uploads if who == person) + int(size) > SETTINGS.upload_quota:
                raise InputError(f"You have uploaded {SETTINGS.upload_quota / 1e9:g} GB within an hour; go on later.")
            free = min(shutil.disk_usage(place).free for place in (self.work.cache, self.work.root))
            if free - int(size) < SETTINGS.disk_left:
                raise InputError("The disk of the studio is full; it takes no more uploads.")
            self._uploads.append((now, person, int(size)))

    def projects(self, person: str) -> list[Project]:
        """The projects that a person may open: all on one's own machine, else one's own and `start`."""
        every = self.work.projects(None if self.single_user else person)
        start = self.start
        return every if not isinstance(start, Project) or start in every else [*every, start]

    def project(self, name: str, person: str) -> Project:
        """The project of a name that came from a page. Raises InputError where this person has no such project."""
        for project in self.projects(person):
            if project.name == name:
                return project
        raise InputError("This photo is no longer in the work folder; open it again.")

    def open(self, session: Session, name: str) -> None:
        """Open a project of this person on a page. Raises InputError where the memory would not suffice."""
        project = self.project(name, session.person)
        session.close()
        free_memory().result()
        if psutil.virtual_memory().available < SETTINGS.free_for_scene:
            raise InputError("This machine has no memory left for another scene; close one in another tab.")
        session.open(project)
        self.note_last(session.person, name)

    def note_last(self, person: str, name: str) -> None:
        """Note the project that a person opened or began last; those who did so longest ago are forgotten."""
        self.last.pop(person, None)
        self.last = dict([*self.last.items(), (person, name)][-SETTINGS.people :])

    def submit(self, session: Session, task: tasks.Task, folder: Path, **arguments: Any) -> Job:
        """Put a job for a page in the queue: a function of `tasks`, which writes into `folder`.

        Raises InputError where this person, or all together, have too many there.
        """
        mine, all_ = len(self.jobs.unfinished(session.person)), len(self.jobs.unfinished())
        if mine >= SETTINGS.jobs_a_person or all_ >= SETTINGS.jobs:
            whose = f"You have {mine}" if mine >= SETTINGS.jobs_a_person else f"The studio has {all_}"
            raise InputError(f"{whose} jobs waiting or running; stop one, or wait until one is done.")
        work = partial(tasks.on_device, self.device, task)
        job = self.jobs.submit(Job(task.__name__, session.person, folder, work, arguments))
        session.note_job(job)
        return job

    def leave(self, page: str | None) -> None:
        """Forget a page that was closed, its memory, and its renderings; its work and its inversions go on."""
        with self._lock:
            session = self._sessions.pop(page or "", None)
        if session is not None:
            session.stop(self.jobs, *ENDING)
            session.close()
            del session
            free_memory()

    def public_copy(self, file: Path, name: str = "") -> str:
        """A copy of a result in the cache, the only place of served files, in a folder with a random name.

        `name` is another name for the file.
        """
        folder = self.work.cache / secrets.token_hex(16)
        with writing(file.name):
            folder.mkdir()
            return str(shutil.copyfile(file, folder / (name or file.name)))
