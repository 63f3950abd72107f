"""The running studio: its work folder, its queue of jobs, and the pages that are open."""

import json
import re
import secrets
import shutil
import threading
import time
import traceback
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import psutil

from materialist.errors import InputError, MaterialistError, OutputError
from materialist.io.atomic import writing
from materialist.io.manifest import photo_bytes
from materialist.jobs.process import Worker
from materialist.jobs.queue import Job, JobQueue
from materialist.jobs.worker import DONE
from materialist.memory import give_back
from materialist.studio import SETTINGS, archives, tasks, uploads
from materialist.studio.access.files import HandedFiles
from materialist.studio.access.quota import Allowance, Claim, Quota, sender_of
from materialist.studio.live.process import warmed
from materialist.studio.page import Page
from materialist.studio.session import ENDING, Session
from materialist.studio.workspace import GONE, LOST, Project, WorkFolder, person_of

LOCAL_PERSON = "me"
"""The person, where the studio serves this machine only."""
PERSON = "materialist_person"
"""The cookie that tells whose photos a browser may see."""
PERSON_HEADER = "x-materialist-person"
"""The header in which the gate tells the page whose request it is; what a browser sends of that name is dropped."""
PREDICTORS = (("Automatic", "auto"), ("MatNet", "matnet"), ("Marigold", "marigold"))
"""Ways to make the first guess that a page offers, and their names of `invert`."""
POLL = 0.2
"""Seconds between two looks at the inversion of an open photo."""
_FOLDERS = re.compile(r"(?<![\w/:.<])/(?:[^/\s<>'\"]+/)*(?=[^/\s<>])")


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
    keeps_ready: bool = False
    """Whether processes get ready for the next photo as soon as somebody is about to choose one."""
    last: dict[str, str] = field(default_factory=dict)
    """Person -> the project last opened or begun; a page goes on with it, after a restart, too."""
    files: HandedFiles = field(default_factory=HandedFiles)
    """What requests may name: uploads, and results that were handed over."""
    senders: dict[str, str] = field(default_factory=dict)
    """Person -> the address of their last request."""
    _pages: dict[str, Page] = field(default_factory=dict)
    _left: list[Session] = field(default_factory=list)
    """Sessions that no page shows any more, whose memory is not given back yet."""
    _spare: Worker | None = None
    """A process that has loaded what a preview needs, for the next photo."""
    _spare_until: float = 0.0
    """Until when it waits for one, by the monotonic clock; longer where a photo is being taken apart."""
    _closer: ThreadPoolExecutor = field(
        default_factory=lambda: ThreadPoolExecutor(1, thread_name_prefix="closer")
    )
    _lock: threading.RLock = field(default_factory=threading.RLock)

    def __post_init__(self) -> None:
        self.quota = Quota(self.work.cache, self.work.root, patient=self.single_user)
        self.last = self.work.read_last()

    def person(self, token: Any) -> str:
        """The name of a page's person, from the cookie that their browser keeps. Raises InputError for none of ours."""
        return LOCAL_PERSON if self.single_user else person_of(token)

    def page(self, name: str | None, person: str) -> Page:
        """The page of a name, new where there is none. Forgets pages that were not heard of for a while.

        Raises InputError for no name, another person's page, and too many pages.
        """
        self.leave_idle(name)
        with self._lock:
            known = self._pages.get(name or "")
            if known is None and name:
                sender = self.sender(person)
                self._check_pages(sender)
                known = self._pages[name] = Page(person, self._new_session(person), sender)
            if known is None or known.person != person:
                raise InputError(LOST)
            known.seen = time.monotonic()
        return known

    def leave_idle(self, name: str | None = None) -> None:
        """Forget the pages that ask for nothing, and were not heard of for a while, but for one."""
        last = time.monotonic() - SETTINGS.page_seconds
        with self._lock:
            gone = [
                known
                for known, page in self._pages.items()
                if not page.is_open and page.seen < last and known != name
            ]
        for known in gone:
            self.leave(known)
        self._rest()

    def _rest(self) -> None:
        """End the processes of previews that nobody asks for anything, or that no photo is coming for."""
        with self._lock:
            live = [page.session.live for page in self._pages.values()]
        for one in live:
            if one is not None:
                one.rest(SETTINGS.preview_idle)
        late = time.monotonic() > self._spare_until
        if late and not self.jobs.unfinished(kind=tasks.invert.__name__):
            spare = self._take_spare()
            if spare is not None:
                spare.close()

    def _take_spare(self) -> Worker | None:
        with self._lock:
            spare, self._spare = self._spare, None
        return spare if spare is not None and spare.running else None

    def _check_pages(self, sender: str) -> None:
        """Raise InputError where a sender has too many pages open."""
        count = sum(page.sender == sender for page in self._pages.values())
        if count >= SETTINGS.pages:
            raise InputError(
                f"There are {SETTINGS.pages} pages open from your address; close some."
            )

    def session_on(self, project: Project, person: str) -> Session | None:
        """The session in which pages of a person show a photo; None where none does."""
        with self._lock:
            sessions = (page.session for page in self._pages.values() if page.person == person)
            return next((one for one in sessions if one.shows(project)), None)

    def _new_session(self, person: str) -> Session:
        allowance = Allowance(self.quota, lambda: self.sender(person))
        return Session(person, self.without_folders, self.single_user, allowance, self.device)

    def without_folders(self, text: str) -> str:
        """A text for a page: names in place of the paths of this machine."""
        for root in (self.work.root, self.work.cache):
            text = text.replace(f"{root}/", "/")
        return _FOLDERS.sub("", text)

    def note_sender(self, person: str, address: str) -> None:
        """Remember where a person's requests come from; those seen longest ago are forgotten."""
        with self._lock:
            self.senders.pop(person, None)
            self.senders[person] = sender_of(address)
            while len(self.senders) > SETTINGS.people:
                del self.senders[next(iter(self.senders))]

    def sender(self, person: str) -> str:
        """The address that the person's requests come from."""
        return self.senders.get(person, person)

    def claim(self, person: str, size: int) -> Claim:
        """Count bytes that a person is about to store. Raises InputError above the quota, or where the disk is full."""
        return self.quota.claim(self.sender(person), size)

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
        raise InputError(GONE)

    def open(self, page: Page, name: str) -> None:
        """Show a project of this person on a page; where another page of theirs shows it, both share the session.

        Raises InputError where the memory would not suffice.
        """
        project = self.project(name, page.person)
        if page.left:
            raise InputError("The page was closed.")
        session = self.session_on(project, page.person)
        if session is not page.session or session is None:
            # The old scene goes first: both at once may not fit into memory.
            self.put_away(page)
        with self._lock:
            session = self.session_on(project, page.person) or page.session
            session.expected = project
            page.session = session
        inversions = self.jobs.unfinished(kind=tasks.invert.__name__)
        job = next((job for job in inversions if job.folder == project.folder), None)
        try:
            # Whoever comes second waits until it is open.
            with session.lock:
                if session.live is None:
                    _check_memory(project)
                    session.open(project, self._take_spare())
                else:
                    session.take_over()
        except Exception:
            self.put_away(page)
            raise
        self.note_last(page.person, name)
        if job is not None:
            threading.Thread(target=_complete, args=(session, project, job), daemon=True).start()

    def put_away(self, page: Page) -> None:
        """Give a page an empty session; the scene of the one before goes when no other page shows it."""
        with self._lock:
            before = page.session
            page.session = self._new_session(page.person)
            shared = any(other.session is before for other in self._pages.values())
        if not shared:
            had_scene = before.live is not None
            before.stop(self.jobs, *ENDING)
            before.close()
            if had_scene:
                give_back()

    def discard(self, project: Project) -> None:
        """Delete a project: its jobs are stopped, and the pages that show it have none."""
        for job in self.jobs.unfinished():
            if job.folder == project.folder or job.folder.parent == project.folder:
                self.jobs.stop(job)
        with self._lock:
            pages = [page for page in self._pages.values() if page.session.shows(project)]
        for page in pages:
            self.put_away(page)
        self.work.discard(project)

    def note_last(self, person: str, name: str) -> None:
        """Note the project that a person opened or began last; those who did so longest ago are forgotten."""
        # Put back last: the oldest entries go first.
        self.last.pop(person, None)
        self.last = dict([*self.last.items(), (person, name)][-SETTINGS.people :])
        self._write_last()

    def forget_last(self, person: str) -> None:
        """Forget which project a person had: they went back to the choice of photos."""
        if self.last.pop(person, None) is not None:
            self._write_last()

    def _write_last(self) -> None:
        # Without it people choose their photo after a restart: no reason to refuse one on a full disk.
        with suppress(OutputError):
            self.work.write_last(self.last)

    def submit(self, session: Session, task: tasks.Task, folder: Path, **arguments: Any) -> Job:
        """Put a job for a page in the queue: a function of `tasks`, which writes into `folder`.

        Raises InputError where this person, or all together, have too many there.
        """
        unfinished = self.jobs.unfinished()
        sender = self.sender(session.person)
        # Counted by sender, not by person: a new cookie is free.
        mine = sum(job.sender == sender for job in unfinished)
        all_ = len(unfinished)
        if mine >= SETTINGS.jobs_a_person or all_ >= SETTINGS.jobs:
            whose = (
                f"You have {mine}" if mine >= SETTINGS.jobs_a_person else f"The studio has {all_}"
            )
            raise InputError(
                f"{whose} jobs waiting or running; stop one, or wait until one is done."
            )
        self.quota.check_disk()
        work = partial(tasks.on_device, self.device, task)
        job = self.jobs.submit(Job(task.__name__, session.person, folder, work, arguments, sender))
        session.note_job(job)
        return job

    def get_ready(self) -> None:
        """Let processes load what taking a photo apart and its preview need, while somebody chooses one."""
        if self.keeps_ready and not self.jobs.unfinished():
            self.jobs.warm(
                partial(tasks.on_device, self.device, tasks.warm), SETTINGS.ready_seconds
            )
            self._warm_preview()

    def begin(
        self, session: Session, source: Path, predictor: str, size: int, fov: str
    ) -> tuple[Project, Job]:
        """A project with a copy of an uploaded photo in it, and its inversion in the queue. Raises InputError."""
        # --- What was uploaded can be read ---
        if predictor not in {value for _, value in PREDICTORS}:
            raise InputError("Choose one of the listed ways to make the first guess.")
        uploads.opened_upload(
            uploads.checked_upload, source, session.allowance, option=uploads.PHOTO
        )
        # --- A project of its own, with a copy of the photo ---
        project = self.work.new(source.name, session.person)
        photo = project.folder / f"original{source.suffix.lower()}"
        try:
            session.allowance.claim(source.stat().st_size)
            shutil.copyfile(source, photo)
            job = self.submit(
                session,
                tasks.invert,
                project.folder,
                photo=str(photo),
                scene=str(project.scene),
                title=project.title,
                predictor=predictor,
                size=size,
                fov=fov.strip() or "auto",
                seed=self.seed,
            )
        except Exception:
            shutil.rmtree(project.folder, ignore_errors=True)
            raise
        if self.keeps_ready:
            threading.Thread(target=self._warm_later, args=(job,), daemon=True).start()
        return project, job

    def _warm_later(self, job: Job) -> None:
        """`_warm_preview` once an inversion has found the first maps, which come first."""
        while all(result["name"] == tasks.PHOTO for result in job.intermediate):
            if job.over:
                return
            time.sleep(0.1)
        self._warm_preview()

    def _warm_preview(self) -> None:
        """Let a process load what the preview of the next photo needs, unless there is one."""
        with self._lock:
            self._spare_until = time.monotonic() + SETTINGS.ready_seconds
            if self._spare is None or not self._spare.running:
                self._spare = warmed(self.device)

    def unpack(self, session: Session, file: Path) -> Project:
        """A project with an uploaded, zipped scene package. Raises InputError."""
        project = self.work.new(file.stem, session.person)
        try:
            archives.unpack_scene(file, project.scene, session.allowance)
        except Exception:
            shutil.rmtree(project.folder, ignore_errors=True)
            raise
        return project

    def leave(self, name: str | None) -> None:
        """Forget a page that was closed; its work, its inversions and final pictures go on.

        The memory of a session that no page shows any more is given back later, in another thread, together with that
        of others.
        """
        with self._lock:
            page = self._pages.pop(name or "", None)
            if page is None:
                return
            page.left = True
            session = page.session
            if any(other.session is session for other in self._pages.values()):
                return
            self._left.append(session)
            # One closing takes all who left meanwhile: many tabs are often closed together.
            first = len(self._left) == 1
        session.stop(self.jobs, *ENDING)
        if first:
            self._closer.submit(self.close_left)

    def close_left(self) -> None:
        """Close the sessions that no page shows, and give their memory back, once for all of them."""
        with self._lock:
            sessions = self._left
            self._left = []
        had_scene = any(session.live is not None for session in sessions)
        for session in sessions:
            try:
                session.close()
            except Exception as error:  # the others are closed all the same
                traceback.print_exception(error)
        sessions.clear()
        if had_scene:
            give_back()

    def close(self) -> None:
        """End all that works for it: jobs, previews, and the process that waits for a photo."""
        self.jobs.close()
        with self._lock:
            pages = [*self._pages]
        for name in pages:
            self.leave(name)
        spare = self._take_spare()
        if spare is not None:
            spare.close()
        self._closer.shutdown()

    def public_copy(self, person: str, file: Path, name: str = "") -> str:
        """A copy of a result for a person, in the cache, the only place of served files; its path.

        It lies in a folder with a random name, and this person may name it in requests. `name` is another name for
        the file.
        """
        self.claim(person, file.stat().st_size)
        folder = self.work.cache / secrets.token_hex(16)
        with writing(file.name):
            folder.mkdir()
            # A copy: the original may be replaced while somebody downloads it.
            copy = Path(shutil.copyfile(file, folder / (name or file.name)))
        return self.files.hand_out(person, copy, str(copy))


def _complete(session: Session, project: Project, job: Job) -> None:
    """Let an open photo have its path-traced re-rendering, once its inversion is over."""
    while not job.over:
        time.sleep(POLL)
    live = session.live
    # It may have been closed, or another one opened.
    if live is not None and job.state == DONE and session.shows(project):
        with suppress(MaterialistError):
            live.take_rerender()
            session.changed()


def _check_memory(project: Project) -> None:
    """Raise InputError where too little memory is free for a scene."""
    if psutil.virtual_memory().available < _memory_of(project):
        raise InputError(
            "This machine has no memory left for another scene; close one in another tab."
        )


def _memory_of(project: Project) -> float:
    """Bytes of memory that opening a project takes, by the sizes of its scene and its photo."""
    with suppress(Exception):  # `load_scene` tells what is wrong with a damaged package
        meta = json.loads((project.scene / "scene.json").read_text("utf-8"))
        pixels = int(meta["camera"]["width"]) * int(meta["camera"]["height"])
        photo = photo_bytes(project.scene / Path(meta["photo"]["original"]).name)
        # Both the studio and the preview decode the photo.
        return SETTINGS.free_for_scene + SETTINGS.free_a_pixel * pixels + 2 * photo
    return SETTINGS.free_for_scene
